#include "exchange/poses/osc_message.h"

#include <lo/lo.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "core/utf8.h"

namespace limn::exchange {
namespace {

constexpr std::size_t k_longest_printed = 200;  // bytes

struct FreeMessage {
  void operator()(lo_message message) const { lo_message_free(message); }
};
using LoMessage = std::unique_ptr<std::remove_pointer_t<lo_message>, FreeMessage>;

// Reads the padded text that begins at `at`; nullopt: it has no end.
std::optional<std::string> text_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(std::min(at, bytes.size()));
  const auto end = std::find(begin, bytes.end(), 0);
  if (end == bytes.end()) return std::nullopt;
  return std::string(begin, end);
}

// The type letters of a message; nullopt: it is not a message.
std::optional<std::string> types_of(std::span<const std::uint8_t> bytes) {
  const auto path = text_at(bytes, 0);
  if (!path || path->empty() || path->front() != '/') return std::nullopt;
  const auto types = text_at(bytes, (path->size() / 4 + 1) * 4);
  if (!types || types->empty() || types->front() != ',') return std::nullopt;
  return types->substr(1);
}

// The types that are read. Other types are not passed to liblo (0.31): it reads beyond the end of a blob that
// was cut off.
const std::string k_known_types = {LO_INT32,  LO_INT64,  LO_FLOAT, LO_DOUBLE,
                                   LO_STRING, LO_SYMBOL, LO_TRUE,  LO_FALSE};

// liblo aligns all values to 4 bytes only, whatever their type.
template <class T>
T value_at(const void* at) {
  T out;
  std::memcpy(&out, at, sizeof out);
  return out;
}

OscArgument argument_of(char type, const void* at) {
  switch (type) {
    case LO_INT32:
      return {type, static_cast<double>(value_at<std::int32_t>(at))};
    case LO_INT64:
      return {type, static_cast<double>(value_at<std::int64_t>(at))};
    case LO_FLOAT:
      return {type, static_cast<double>(value_at<float>(at))};
    case LO_DOUBLE:
      return {type, value_at<double>(at)};
    case LO_TRUE:
      return {type, 1.0};
    case LO_FALSE:
      return {type, 0.0};
    default:
      return {type, std::string(static_cast<const char*>(at))};
  }
}

}  // namespace

std::optional<double> OscArgument::number() const {
  if (type == LO_TRUE || type == LO_FALSE) return std::nullopt;
  const double* found = std::get_if<double>(&value);
  return found ? std::optional(*found) : std::nullopt;
}

bool is_osc_bundle(std::span<const std::uint8_t> datagram) {
  constexpr std::string_view k_begin{"#bundle", 8};  // with the zero that ends it
  return datagram.size() >= k_begin.size() && std::equal(k_begin.begin(), k_begin.end(), datagram.begin());
}

bool is_printable(const std::string& text) {
  const auto is_control = [](unsigned char byte) { return byte < 0x20 || byte == 0x7f; };
  return is_utf8(text) && std::none_of(text.begin(), text.end(), is_control);
}

// A character that is cut off becomes U+FFFD.
std::string printable(const std::string& text) {
  return is_printable(text) ? as_utf8(text.substr(0, k_longest_printed)) : "?";
}

Result<OscMessage> parsed_osc(std::span<const std::uint8_t> datagram) {
  std::vector<std::uint8_t> bytes(datagram.begin(), datagram.end());
  if (is_osc_bundle(bytes)) return error("expected a message, found a bundle. Send its messages one by one.");
  const auto types = types_of(bytes);
  const auto unknown = types ? types->find_first_not_of(k_known_types) : std::string::npos;
  if (unknown != std::string::npos)
    return error("{}: expected text, numbers, true or false, found an argument of type '{}'.",
                 printable(*text_at(bytes, 0)), printable(types->substr(unknown, 1)));
  int problem = 0;
  const LoMessage message(!types ? nullptr : lo_message_deserialise(bytes.data(), bytes.size(), &problem));
  if (!message)
    return error("expected a message of Open Sound Control 1.0, found {} other bytes.", bytes.size());
  OscMessage out{reinterpret_cast<const char*>(bytes.data()), {}};
  lo_arg** values = lo_message_get_argv(message.get());
  for (int i = 0; i < lo_message_get_argc(message.get()); ++i)
    out.arguments.push_back(argument_of((*types)[static_cast<std::size_t>(i)], values[i]));
  return out;
}

std::vector<std::uint8_t> osc_message(const std::string& path, const std::vector<OscValue>& arguments) {
  const LoMessage message(lo_message_new());
  LIMN_CHECK(message != nullptr);
  for (const OscValue& argument : arguments) {
    if (const int* whole = std::get_if<int>(&argument))
      lo_message_add_int32(message.get(), *whole);
    else if (const float* number = std::get_if<float>(&argument))
      lo_message_add_float(message.get(), *number);
    else
      lo_message_add_string(message.get(), std::get<std::string>(argument).c_str());
  }
  std::vector<std::uint8_t> bytes(lo_message_length(message.get(), path.c_str()));
  lo_message_serialise(message.get(), path.c_str(), bytes.data(), nullptr);
  return bytes;
}

}  // namespace limn::exchange
