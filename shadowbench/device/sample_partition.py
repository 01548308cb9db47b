"""Median splits of samples: the step that BSP construction repeats.

:func:`split_at_median` is a quickselect (Hoare 1961, Algorithm 65, which the alias-free paper uses) with a native body:
its inner loop swaps whole records without a branch, which would be mispredicted at every other sample.
:func:`split_at_median_plainly` does the same in plain Warp and is the oracle in tests.
"""

import warp as wp

from shadowbench.device.launch import kernel_options

wp.set_module_options(kernel_options(native=True))


@wp.func_native("""
    typedef float record __attribute__((ext_vector_type(4)));
    record* r = (record*)records.data;
    int low = begin, high = end;  // the median's final place lies within
    while (high - low > 1) {
        // pivot: the middle of nine samples, by counting how many are smaller
        float sample[9], pivot = 0.0f;
        const int count = high - low < 9 ? high - low : 9;
        for (int k = 0; k < count; ++k) sample[k] = r[low + (int)((high - low - 1LL) * k / (count - 1))][axis];
        for (int k = 0; k < count; ++k) {
            int rank = 0;
            for (int j = 0; j < count; ++j) rank += sample[j] < sample[k] || (sample[j] == sample[k] && j < k);
            if (rank == count / 2) pivot = sample[k];
        }
        // smaller ones to the front (Lomuto 1984), the swap unconditional
        int at = low;
        for (int i = low; i < high; ++i) {
            const record here = r[i];
            r[i] = r[at];
            r[at] = here;
            at += here[axis] < pivot;
        }
        if (middle < at) { high = at; continue; }
        // equal ones next, so that many equal coordinates cannot stall the search
        int equal = at;
        if (at - low < (high - low) / 8 || at == low) {
            for (int i = at; i < high; ++i) {
                const record here = r[i];
                r[i] = r[equal];
                r[equal] = here;
                equal += here[axis] == pivot;
            }
            if (middle < equal) return;
        }
        low = equal;
    }
""")
def split_at_median(records: wp.array[wp.vec4], begin: wp.int32, middle: wp.int32, end: wp.int32, axis: wp.int32): ...


@wp.func
def split_at_median_plainly(
    records: wp.array[wp.vec4], begin: wp.int32, middle: wp.int32, end: wp.int32, axis: wp.int32
):
    """Reorder ``records[begin:end]`` so that none before ``middle`` is larger along ``axis`` than one from there on."""
    low = begin
    high = end - 1
    while low < high:
        pivot = records[(low + high) / 2][axis]
        i = low
        j = high
        while i <= j:
            while records[i][axis] < pivot:
                i += 1
            while pivot < records[j][axis]:
                j -= 1
            if i <= j:
                swapped = records[i]
                records[i] = records[j]
                records[j] = swapped
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            low = high
