#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.h"
#include "scene/scene.h"
#include "scene/show_state.h"

namespace limn::scene {

/// The text of a limn.drawn/1 file: drawn lines, and the names of those that are shown; empty when there are
/// none. with_drawn_lines() adds those of a file to a show state; one that has the name of a line of the
/// scene gets another name. Errors: no such file, points that are no line, too many lines or points.
std::string drawn_lines_json(const std::vector<DrawnLine>& drawn, const std::vector<std::string>& shown);
Result<ShowState> with_drawn_lines(const std::filesystem::path& path,
                                   const Scene& scene,
                                   ShowState show_state);

/// The curves among the lines that a posed scene shows, with their lines' names, in the prototype's frame.
std::vector<exchange::NamedCurve> shown_curves(const Scene& scene, const PosedScene& posed);

// What people do with the lines that they draw in a session. Errors are sentences without the action's name:
// "expected ..., found ...". A name that is empty means the line drawn last.

/// Draws on: adds the stroke to the drawn line of that name, or begins it and shows it. Without a name a new
/// line begins (line-01 and so on). Rays that miss the prototype are left out. The first points of a stroke
/// may be one point only. Errors: no prototype, a name of the scene's lines, nothing on the surface, too many
/// lines or points.
Status draw_line(const Scene& scene, const std::string& name, const Stroke& stroke, ShowState* show_state);
/// Removes a drawn line.
Status erase_line(const std::string& name, ShowState* show_state);
/// Makes a drawn line smoother: the least-squares compromise between its points and small second
/// differences, of which 10 mm of the line matter. Its ends stay.
Status smooth_line(const Scene& scene, const std::string& name, ShowState* show_state);
/// Moves the place of a drawn line that is nearest to the stroke's first point (within 15 mm) to its last
/// one; places within 20 mm along the line follow, less with their distance.
Status move_line(const Scene& scene, const std::string& name, const Stroke& stroke, ShowState* show_state);
Status rename_line(const Scene& scene,
                   const std::string& name,
                   const std::string& new_name,
                   ShowState* show_state);

}  // namespace limn::scene
