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
/// after the other. Points of a boundary are the middles of its cracks, clockwise as seen (x right, y down).
/// Holds its buffers between calls.
class Contours {
 public:
  /// Of a boundary as it is traced.
  struct Extent {
    std::size_t count = 0;  ///< cracks
    double area = 0;        ///< square pixels; negative around a hole
  };
  struct Box {
    double width = 0, height = 0;
  };
  /// Total least squares line of some points.
  struct Line {
    Eigen::Vector2d p, d;  ///< centroid, unit direction along the boundary
    double squares = 0;    ///< sum of squared distances, px^2
    double count = 0;
  };

  /// Calls visit(extent) with every boundary once, those of the upper and the lower half as they are
  /// traced; what follows is about that one. Sets the visited bits of `corners`.
  template <typename Visit>
  void for_each(CornerCodes& corners, const Visit& visit) {
    static_assert(2 * k_max_image_side <= 0xFFFF);
    LIMN_CHECK(corners.width <= k_max_image_side && corners.height <= k_max_image_side);
    begin(corners);
    while (const auto extent = trace_next(corners)) visit(*extent);
  }

  /// Around all points.
  Box box() const;

  /// Finds the boundary's corners (Douglas and Peucker from two far points), no more than `max_count` and
  /// some; pieces of fewer than `min_run` points are not split further.
  void find_corners(double tolerance_px, std::size_t max_count, std::size_t min_run = 2);

  /// Indices of points, ascending, the first 0. Points are counted from there, and on into a second round.
  std::span<const std::size_t> corners() const { return corners_; }
  std::size_t size() const { return count_; }
  Eigen::Vector2d point(std::size_t i) const { return at(points_[i]); }

  /// Of the points from ... to - 1; nullopt when their RMS distance from it is larger.
  std::optional<Line> line(std::size_t from, std::size_t to, double max_rms_px) const;

 private:
  // In half pixels from the image's upper left corner: x in the lower 16 bits, y in the upper.
  using Packed = std::uint32_t;
  // How a boundary goes on from one corner to the next.
  struct Step {
    std::int32_t offset = 0;  // to the next corner's code
    std::int16_t next = 0;    // 32 * direction
    std::int8_t dy = 0;       // of the way
    std::uint8_t code = 0;    // that the corner has then: visited where boundaries start
  };
  // By 32 * direction + corner code.
  struct Way {
    std::array<Step, 128> steps;
    std::array<Packed, 128> moves;  // halves of the steps
  };
  struct Steps {
    Way on, back;  // with black on its right, and the other way
    explicit Steps(std::ptrdiff_t stride);
  };
  // One end of what has been traced of a boundary.
  struct End {
    std::uint8_t* corner = nullptr;
    std::size_t direction = 0;  // times 32
    Packed at = 0;              // the corner
    std::int64_t area = 0;      // half pixels times pixels

    Packed go_on(const Way& way);
  };
  // A boundary as it is traced, from both of its ends in turn, so that neither has to wait for what it reads.
  struct Tracing {
    std::vector<Packed> trail;  // of both ends, to both sides from the middle on
    std::size_t on = 0, back = 0;
    std::uint8_t* start = nullptr;    // null: there is none
    std::size_t next = 0, until = 0;  // codes that are still to be looked through for a start
    End end, begin;

    Packed* middle_with_room();
  };
  Steps steps_{0};
  std::array<Tracing, 2> tracings_;  // both at a time, for the same reason
  std::size_t last_ = 0;             // of the tracings, that of the boundary that was traced last
  std::size_t begin_ = 0;            // of it within the trail
  std::size_t count_ = 0;            // points
  std::span<const Packed> points_;   // from the first corner on, and that one again at the end
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
