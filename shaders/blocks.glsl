// A projector's image of ids in square blocks, and how far around a jump of depth its light fades.

const int k_block = 8;  // texels a side
const int k_fade = 8;   // blocks over which light rises, from beyond the neighbours of a block with a jump on
const int k_farthest = k_fade + 2;
