// A projector's id image is divided into square blocks. Its light fades within some blocks of a depth edge.

const int k_block = 8;  // texels for each side
const int k_fade = 8;   // blocks over which light rises, outside the neighbours of a block with an edge
const int k_farthest = k_fade + 2;
