#include "exchange/curves/named_curve.h"

#include <algorithm>

namespace limn::exchange {

Status check_curve(const NamedCurve& curve, const std::string& where) {
  const std::size_t least = curve.is_closed ? 3 : 2, count = curve.points.size();
  if (count < least)
    return error("{}: curve '{}': expected at least {} points, found {}. Draw it longer, or leave it out.",
                 where, curve.name, least, count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t next = (i + 1) % count;
    if (!curve.points[i].allFinite())
      return error("{}: curve '{}': expected points of finite numbers, found another at point {}.", where,
                   curve.name, i);
    if ((next != 0 || curve.is_closed) && curve.points[i] == curve.points[next])
      return error(
          "{}: curve '{}': expected points that differ from their neighbours, found {} and {} equal. Leave "
          "one out.",
          where, curve.name, i, next);
  }
  return {};
}

}  // namespace limn::exchange
