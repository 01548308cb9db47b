"""Exponential, logarithm, sine and cosine of float32: the same bits on every machine, alone and in vectors.

The system's library differs between machines in the last bit, and takes numbers one by one. Here each function is a
short polynomial after an exact reduction (the coefficients are those of Cephes, Moshier 1989, for e^x and ln x, and
Taylor's for sin πx and cos πx), once as a Warp function and once as text for native bodies, where ``floats`` and
``ints`` are vectors; the two agree bit for bit, but for the sign of a zero. Native bodies that use the text come from
modules with ``kernel_options(native=True)``, which keeps multiplications and additions apart.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))

LEAST_EXPONENT = wp.constant(wp.float32(-87.0))
GREATEST_EXPONENT = wp.constant(wp.float32(88.0))
"""The exponential's argument is clamped to this range: beyond it e^x is subnormal or infinite in float32."""

LOG2_E = wp.constant(wp.float32(1.44269504088896341))
LN2_HIGH = wp.constant(wp.float32(0.693359375))
LN2_LOW = wp.constant(wp.float32(-2.12194440e-4))
"""ln 2 in two parts, of which the first has so few digits that its product with an exponent is exact."""

SQRT_HALF = wp.constant(wp.float32(0.707106781186547524))

VECTOR_EXPONENTIAL = """
    auto exponential = [](floats x) {
        x = x < -87.0f ? (floats)-87.0f : x;
        x = x > 88.0f ? (floats)88.0f : x;
        const floats n = __builtin_elementwise_roundeven(x * 1.44269504088896341f);
        const floats r = (x - n * 0.693359375f) - n * -2.12194440e-4f;
        floats p = r * 1.9875691500e-4f + 1.3981999507e-3f;
        p = p * r + 8.3334519073e-3f;
        p = p * r + 4.1665795894e-2f;
        p = p * r + 1.6666665459e-1f;
        p = p * r + 5.0000001201e-1f;
        p = (p * r) * r + r + 1.0f;
        return p * (floats)((__builtin_convertvector(n, ints) + 127) << 23);
    };
"""


@wp.func
def exponential(x: wp.float32):
    """Return e^x, within an ulp; the argument is clamped to [-87, 88]."""
    x = wp.clamp(x, LEAST_EXPONENT, GREATEST_EXPONENT)
    n = wp.rint(x * LOG2_E)
    r = (x - n * LN2_HIGH) - n * LN2_LOW
    p = r * wp.float32(1.9875691500e-4) + wp.float32(1.3981999507e-3)
    p = p * r + wp.float32(8.3334519073e-3)
    p = p * r + wp.float32(4.1665795894e-2)
    p = p * r + wp.float32(1.6666665459e-1)
    p = p * r + wp.float32(5.0000001201e-1)
    p = (p * r) * r + r + wp.float32(1.0)
    return p * wp.cast((wp.int32(n) + 127) << 23, wp.float32)


VECTOR_LOGARITHM = """
    auto logarithm = [](floats x) {
        const ints bits = (ints)x;
        const ints shifted = bits - 0x3f3504f3;  // the bits of sqrt(1/2)
        const floats n = __builtin_convertvector(shifted >> 23, floats);
        const floats r = (floats)((shifted & 0x007fffff) + 0x3f3504f3) - 1.0f;
        floats p = r * 7.0376836292e-2f - 1.1514610310e-1f;
        p = p * r + 1.1676998740e-1f;
        p = p * r - 1.2420140846e-1f;
        p = p * r + 1.4249322787e-1f;
        p = p * r - 1.6668057665e-1f;
        p = p * r + 2.0000714765e-1f;
        p = p * r - 2.4999993993e-1f;
        p = p * r + 3.3333331174e-1f;
        const floats square = r * r;
        p = (p * r) * square + n * -2.12194440e-4f;
        p = p - square * 0.5f;
        return (r + p) + n * 0.693359375f;
    };
"""


@wp.func
def logarithm(x: wp.float32):
    """Return ln x of a normal positive number, within an ulp."""
    shifted = wp.cast(x, wp.int32) - wp.int32(0x3F3504F3)  # the bits of sqrt(1/2)
    n = wp.float32(shifted >> 23)
    r = wp.cast((shifted & wp.int32(0x007FFFFF)) + wp.int32(0x3F3504F3), wp.float32) - wp.float32(1.0)
    p = r * wp.float32(7.0376836292e-2) - wp.float32(1.1514610310e-1)
    p = p * r + wp.float32(1.1676998740e-1)
    p = p * r - wp.float32(1.2420140846e-1)
    p = p * r + wp.float32(1.4249322787e-1)
    p = p * r - wp.float32(1.6668057665e-1)
    p = p * r + wp.float32(2.0000714765e-1)
    p = p * r - wp.float32(2.4999993993e-1)
    p = p * r + wp.float32(3.3333331174e-1)
    square = r * r
    p = (p * r) * square + n * LN2_LOW
    p = p - square * wp.float32(0.5)
    return (r + p) + n * LN2_HIGH


# after the whole quarter turns n are taken off, a fourth of a turn remains, between -1/4 and 1/4 of pi
VECTOR_SINE_AND_COSINE = """
    auto sine_and_cosine = [](floats x, floats& sine, floats& cosine) {
        const floats n = __builtin_elementwise_roundeven(x + x);
        const floats t = (x - n * 0.5f) * 3.14159265358979324f;
        const floats u = t * t;
        floats s = u * 2.7557319224e-6f - 1.9841269841e-4f;
        s = s * u + 8.3333333333e-3f;
        s = s * u - 1.6666666667e-1f;
        s = (s * u) * t + t;
        floats c = u * 2.4801587302e-5f - 1.3888888889e-3f;
        c = c * u + 4.1666666667e-2f;
        c = c * u - 0.5f;
        c = c * u + 1.0f;
        const ints quarter = __builtin_convertvector(n, ints);
        const floats first = (quarter & 1) != 0 ? c : s;
        const floats second = (quarter & 1) != 0 ? s : c;
        sine = (quarter & 2) != 0 ? -first : first;
        cosine = ((quarter + 1) & 2) != 0 ? -second : second;
    };
"""


@wp.func
def sine_and_cosine(x: wp.float32):
    """Return (sin πx, cos πx), within 2⁻²³."""
    n = wp.rint(x + x)
    t = (x - n * wp.float32(0.5)) * wp.float32(3.14159265358979324)
    u = t * t
    s = u * wp.float32(2.7557319224e-6) - wp.float32(1.9841269841e-4)
    s = s * u + wp.float32(8.3333333333e-3)
    s = s * u - wp.float32(1.6666666667e-1)
    s = (s * u) * t + t
    c = u * wp.float32(2.4801587302e-5) - wp.float32(1.3888888889e-3)
    c = c * u + wp.float32(4.1666666667e-2)
    c = c * u - wp.float32(0.5)
    c = c * u + wp.float32(1.0)
    quarter = wp.int32(n)
    first = s
    second = c
    if quarter & 1 != 0:
        first = c
        second = s
    if quarter & 2 != 0:
        first = -first
    if (quarter + 1) & 2 != 0:
        second = -second
    return wp.vec2(first, second)
