// Where textures, images and buffers are bound, in one place: shaders include this file, and so does projector/bindings.h.
// Each line is GLSL and C++ alike. tests/projector/bindings_test.cpp holds both to it.

// Texture units.
const int k_tangents_unit = 0;       // rays of the imager that is drawn
const int k_colour_maps_unit = 1;    // of materials, one a layer
const int k_response_unit = 2;       // display values of a projector
const int k_light_unit = 3;          // linear light that earlier passes drew
const int k_camera_image_unit = 4;   // what a composite is laid over
const int k_projector_ids_unit = 5;  // triangles that projectors see
const int k_eye_ids_unit = 6;        // triangles that the eye sees
const int k_pixel_maps_unit = 7;     // pixels of projectors over tangents
const int k_edge_fade_unit = 8;      // light of projectors beside depth edges
const int k_colour_mixing_unit = 9;  // what light looks like on the measured surface
const int k_albedo_unit = 10;        // of the prototype
const int k_occlusion_unit = 11;     // how much of the projectors' light arrives
const int k_distances_unit = 12;     // distance fields of parts
const int k_corners_unit = 13;       // of triangles
const int k_normals_unit = 14;       // of triangles
const int k_triangles_unit = 15;     // owner, material and neighbours
const int k_placements_unit = 16;    // where parts stand
const int k_viewpoints_unit = 17;    // of projectors, the eye and the measuring camera
const int k_surface_maps_unit = 18;  // of materials, beyond their colour
const int k_brdf_lut_unit = 19;      // how materials mirror soft light
const int k_depth_unit = 20;         // of a projector's ids
const int k_depth_edges_unit = 21;   // as k_depth_edges_image

// Image units; GL 4.5 promises eight.
const int k_target_image = 0;         // what a pass draws
const int k_cached_hits_image = 1;    // what the centres of a projector's pixels see
const int k_cached_shares_image = 2;  // the share of the light there
const int k_depth_edges_image = 3;    // depth edges, one a block of 8 x 8 texels
const int k_edge_marks_image = 4;     // blocks beside whose edges another projector goes on
const int k_edge_rows_image = 5;      // distances to them along rows
const int k_edge_fade_image = 6;      // as k_edge_fade_unit

// Storage buffers; GL 4.5 promises eight.
const int k_materials_buffer = 3;
const int k_deferred_list_buffer = 5;    // pixels that a pass leaves to another one
const int k_work_list_buffer = 6;        // pixels that a pass lists, or works through
const int k_distance_fields_buffer = 7;  // of parts
