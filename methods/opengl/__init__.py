"""OpenGL as a peer: shadow maps drawn, filtered and looked up by a real rasteriser, on the same scenes and receivers.

What a renderer's programmer would write, through moderngl over EGL, without a window: ``opengl-shadow-map`` with the
hardware's comparing sampler, and exponential and variance shadow maps (``opengl-esm``, ``opengl-vsm``) with their
separable blur and mip chain. It runs on whatever OpenGL the machine has, a graphics card or Mesa's llvmpipe; which one
stands in the row's environment and in the quality key. With several devices, ``GLCONTEXT_DEVICE_INDEX`` chooses.

How the numbers compare with the other methods':

* Depth is linear, as everywhere here. Under a directional light that is what a rasteriser interpolates; under spot and
  point lights the fragment shader writes it, at the price of the early depth test. A point light has six maps.
* Positions are projected in float32 and vertices snapped to a fraction of a texel (llvmpipe: 1/256), where the other
  methods project in float64: texels at a triangle's edge may go either way.
* A depth buffer has 24 bits, the exponential and variance maps are float32. Beyond the border, its texels go on.
* Receivers are uploaded to float32 textures in list order, looked up by a fragment shader that covers one texel each,
  and read back. Every stage ends when the device has finished it. *caster upload*, *receiver upload* and *read-back*
  are the price of not being in the same memory, which a renderer would not pay, and stand apart.

Threads only matter to llvmpipe, which reads their number once a process: with one, everything runs on the calling
thread; with more, so many rasterise, confined like the calling thread to so many processors, while the calling thread,
which transforms vertices and sorts triangles into tiles, waits for most of the time. One of llvmpipe's shortcuts, a
single level of detail for 2x2 neighbours, is off: neighbours in the list may be far apart, and it saves nothing here.

Limits: opaque casters, lights without area, maps as large as the device's largest texture.
"""
