// More samples of a pixel.

uniform int u_samples;  // a pixel: 8 or 4
// No two in one row or column, none near another.
const int k_rows_of_8[8] = int[](3, 6, 0, 5, 2, 7, 1, 4), k_rows_of_4[4] = int[](1, 3, 0, 2);

// Place of sample k in the pixel, from its centre.
vec2 sample_offset(int k) {
  return (vec2(k, u_samples == 4 ? k_rows_of_4[k & 3] : k_rows_of_8[k]) + 0.5) / float(u_samples) - 0.5;
}
