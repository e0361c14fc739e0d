// The binding slots of all textures, images and buffers. The shaders include this file, and so does
// projector/bindings.h: each line is valid GLSL and valid C++. tests/projector/bindings_test.cpp checks both
// sides.

// Texture units.
const int k_tangents_unit = 0;       // rays of the imager that is drawn
const int k_colour_maps_unit = 1;    // colour textures of materials, one in each layer
const int k_response_unit = 2;       // display values of a projector
const int k_light_unit = 3;          // linear light that earlier passes drew
const int k_camera_image_unit = 4;   // the image behind a composite
const int k_projector_ids_unit = 5;  // triangles that projectors see
const int k_viewer_ids_unit = 6;     // triangles that the viewer sees
const int k_pixel_maps_unit = 7;     // tangent -> pixel of each projector
const int k_edge_fade_unit = 8;      // feathering weights of projectors near depth edges
const int k_colour_mixing_unit = 9;  // colour response of the measured surface
const int k_albedo_unit = 10;        // albedo of the prototype
const int k_occlusion_unit = 11;     // share of the projectors' light that arrives
const int k_distances_unit = 12;     // distance fields of parts
const int k_corners_unit = 13;       // corners of triangles
const int k_normals_unit = 14;       // normals of triangles
const int k_triangles_unit = 15;     // owner, material and neighbours of triangles
const int k_placements_unit = 16;    // poses of parts
const int k_viewpoints_unit = 17;    // poses of projectors, viewer and reference camera
const int k_surface_maps_unit = 18;  // textures of materials besides their colour
const int k_brdf_lut_unit = 19;      // how materials reflect soft light
const int k_depth_unit = 20;         // depth buffer of a projector's ids
const int k_depth_edges_unit = 21;   // as k_depth_edges_image
const int k_room_image_unit = 22;    // a picture of the room as surfaces reflect it
const int k_cap_count_unit = 23;     // how often each texel's ray enters and leaves a part behind a cut
const int k_lines_unit = 24;         // lines of light on the prototype
const int k_volumes_unit = 25;       // the values of volumes
const int k_volume_places_unit = 26;  // where parts are in them

// Image units; GL 4.5 guarantees eight.
const int k_target_image = 0;         // the image that a pass draws
const int k_cached_hits_image = 1;    // what the centres of a projector's pixels see
const int k_cached_shares_image = 2;  // the blending shares there
const int k_depth_edges_image = 3;    // depth edges, one for each block of 8 x 8 texels
const int k_edge_marks_image = 4;     // blocks at whose edges another projector takes over
const int k_edge_rows_image = 5;      // distances to these blocks along rows
const int k_edge_fade_image = 6;      // as k_edge_fade_unit

// Storage buffers; GL 4.5 guarantees eight.
const int k_materials_buffer = 3;
const int k_deviation_buffer = 4;        // the prototype's deviation from its CAD
const int k_deferred_list_buffer = 5;    // pixels that a pass leaves to a later one
const int k_work_list_buffer = 6;        // pixels that a pass lists or processes
const int k_distance_fields_buffer = 7;  // bounds and places of the distance fields of parts
