#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/image_io.h"
#include "core/result.h"
#include "tracker/threshold.h"

namespace limn::tracker {

/// The outer boundaries of the connected black regions (8-connected, along the cracks between pixels), one
/// after the other. A boundary's points are the midpoints of its cracks, clockwise as seen (x right, y down).
/// Holds its buffers between calls.
class Contours {
 public:
  /// Length and area of a boundary, known once it is traced.
  struct Extent {
    std::size_t count = 0;  ///< number of cracks
    double area = 0;        ///< square pixels; negative around a hole
  };
  struct Box {
    double width = 0, height = 0;
  };
  /// Total least squares line through some points.
  struct Line {
    Eigen::Vector2d p, d;  ///< centroid, unit direction along the boundary
    double squares = 0;    ///< sum of squared distances, px^2
    double count = 0;
  };

  /// Calls visit(extent) once for every boundary, in the order in which tracing ends; one tracing starts in
  /// the upper half of the image and one in the lower half. During a call, the functions below are about that
  /// boundary. Sets the visited bits of `corners`.
  template <typename Visit>
  void for_each(CornerCodes& corners, const Visit& visit) {
    static_assert(2 * k_max_image_side <= 0xFFFF);
    LIMN_CHECK(corners.width <= k_max_image_side && corners.height <= k_max_image_side);
    begin(corners);
    while (const auto extent = trace_next(corners)) visit(*extent);
  }

  /// The box around all points.
  Box box() const;

  /// Finds the boundary's corners (Douglas and Peucker, starting from two points that are far apart). It
  /// stops soon after `max_count` corners are found. Pieces of fewer than `min_run` points are not split
  /// further.
  void find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run = 2);

  /// Indices of the corners' points, ascending; the first is 0. Point indices start at the first corner;
  /// point(size()) is the first point again, and line() takes indices of a second round.
  std::span<const std::size_t> corners() const { return corners_; }
  std::size_t size() const { return count_; }
  Eigen::Vector2d point(std::size_t i) const { return at(points_[i]); }

  /// Line through the points from `from` to `to` - 1; nullopt when their RMS distance from it is larger than
  /// `max_rms_px`.
  std::optional<Line> line(std::size_t from, std::size_t to, double max_rms_px) const;

 private:
  // A point in half pixels from the image's upper left corner: x in the lower 16 bits, y in the upper.
  using Packed = std::uint32_t;
  // How a boundary continues from one pixel corner to the next.
  struct Step {
    std::int32_t offset = 0;  // from this corner's code to the next corner's
    std::int16_t next = 0;    // 32 * the direction after the step
    std::int8_t dy = 0;       // rows that the step moves
    std::uint8_t code = 0;  // new code of the corner that is left: marked visited where boundaries can start
  };
  // The steps for each 32 * direction + corner code.
  struct Way {
    std::array<Step, 128> steps;
    std::array<Packed, 128> moves;  // half a step each, in Packed units
  };
  struct Steps {
    Way on, back;  // `on` has black on its right, `back` is the opposite direction
    explicit Steps(std::ptrdiff_t stride);
  };
  // One of the two ends of a boundary's traced part.
  struct End {
    std::uint8_t* corner = nullptr;
    std::size_t direction = 0;  // 32 * direction
    Packed at = 0;              // position of the corner
    std::int64_t area = 0;      // half pixels times pixels

    Packed go_on(const Way& way);
  };
  // A boundary while it is traced. Its two ends advance in turn, so that neither waits for the memory that it
  // reads.
  struct Tracing {
    std::vector<Packed> trail;  // points of both ends, stored from the middle in both directions
    std::size_t on = 0, back = 0;
    std::uint8_t* start = nullptr;    // null: no boundary is being traced
    std::size_t next = 0, until = 0;  // range of codes that are still to be searched for a start
    End end, begin;

    Packed* middle_with_room();
  };
  Steps steps_{0};
  std::array<Tracing, 2> tracings_;  // two boundaries are traced at a time, for the same reason
  std::size_t last_ = 0;             // index in tracings_ of the boundary that was traced last
  std::size_t begin_ = 0;            // index in its trail of that boundary's first point
  std::size_t count_ = 0;            // number of points
  std::span<const Packed> points_;   // from the first corner on; the first point is repeated at the end
  std::vector<std::size_t> corners_, pending_;

  static Eigen::Vector2d at(Packed point) {
    return {0.5 * (point & 0xFFFF) - 0.5, 0.5 * (point >> 16) - 0.5};
  }
  void begin(CornerCodes& corners);
  std::optional<Extent> trace_next(CornerCodes& corners);
  void start(CornerCodes& corners, Tracing* tracing) const;
  bool meets(const Way& way, End* moved, Packed* point, const End& end, const End& begin) const;
  void follow(Tracing* tracing) const;
  Tracing& follow_both();
};

}  // namespace limn::tracker
