// More samples of a pixel.

const int k_samples = 4;  // a side of a pixel

// Place of sample k in the pixel, from its centre.
vec2 sample_offset(int k) {
  return (vec2(k % k_samples, k / k_samples) + 0.5) / float(k_samples) - 0.5;
}
