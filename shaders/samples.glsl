// More samples of a pixel.

const int k_samples = 8;
const int k_rows[k_samples] = int[](3, 6, 0, 5, 2, 7, 1, 4);  // no two in one row or column, none near another

// Place of sample k in the pixel, from its centre.
vec2 sample_offset(int k) { return (vec2(k, k_rows[k]) + 0.5) / float(k_samples) - 0.5; }
