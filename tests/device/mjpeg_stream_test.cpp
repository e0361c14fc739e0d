#include "device/mjpeg_stream.h"

#include "tests/device/mjpeg_answer.h"
#include "tests/support/matchers.h"
#include "tests/support/text.h"

namespace limn::device {
namespace {

using test::expect_contains;
using test::k_mjpeg_answer;
using test::mjpeg_part;

constexpr std::size_t k_limit = 1000;

std::string open_part(const std::string& body) {
  return "--frame\r\nContent-Type: image/jpeg\r\n\r\n" + body + "\r\n";
}

std::string chunked(const std::string& text, std::size_t size) {
  std::string chunks;
  for (std::size_t at = 0; at < text.size(); at += size) {
    const std::string data = text.substr(at, size);
    chunks += fmt::format("{:X}\r\n{}\r\n", data.size(), data);
  }
  return chunks;
}

Stamp at(int ms) { return Stamp(std::chrono::milliseconds(ms)); }

// All images in the bytes when they arrive in pieces of `step` bytes.
std::vector<std::string> images(const std::string& bytes, std::size_t step, Status* end = nullptr) {
  MjpegStream stream(k_limit);
  std::vector<std::string> found;
  for (std::size_t i = 0; i < bytes.size(); i += step) {
    const Status fed = stream.feed(std::string_view(bytes).substr(i, step), at(0));
    if (const auto newest = stream.take_newest()) found.push_back(newest->jpeg);
    if (end && !fed) *end = fed;
    if (!fed) break;
  }
  return found;
}

std::string problem_of(const std::string& bytes) {
  Status end;
  images(bytes, bytes.size(), &end);
  return end ? "" : end.message();
}

TEST(MjpegStream, ImagesComeOutHoweverTheBytesAreCut) {
  const std::string binary("\xff\xd8\r\n--fram\r\n\r\n\0\xff\xd9", 17);
  const std::vector<std::string> expected = {"first", binary, "third"};
  const std::string lengths = k_mjpeg_answer + mjpeg_part("first") + mjpeg_part(binary) + mjpeg_part("third");
  const std::string open =
      k_mjpeg_answer + "\r\n" + open_part("first") + open_part(binary) + open_part("third") + "--frame";
  const std::string bare =
      k_mjpeg_answer + "--frame\r\n\r\nfirst\r\n--frame\r\n\r\n" + binary + "\r\n" + mjpeg_part("third");
  const std::string chunks = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n" + k_mjpeg_answer.substr(17) +
                             chunked(lengths.substr(k_mjpeg_answer.size()), 7);
  for (const std::string& bytes : {lengths, open, bare, chunks})
    for (const std::size_t step : {1U, 2U, 3U, 5U}) EXPECT_EQ(images(bytes, step), expected) << step << bytes;
}

TEST(MjpegStream, OnlyTheNewestIsKeptAndItsFirstByteIsItsStamp) {
  MjpegStream stream(k_limit);
  ASSERT_TRUE(stream.feed(k_mjpeg_answer + mjpeg_part("old") + mjpeg_part("older still"), at(10)));
  const std::string last = mjpeg_part("newest");
  ASSERT_TRUE(stream.feed(last.substr(0, last.size() - 8), at(20)));  // only the part's header
  ASSERT_TRUE(stream.feed(last.substr(last.size() - 8, 3), at(30)));
  EXPECT_EQ(stream.take_newest()->jpeg, "older still");
  EXPECT_FALSE(stream.has_part());
  ASSERT_TRUE(stream.feed(last.substr(last.size() - 5), at(40)));
  const auto newest = stream.take_newest();
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->jpeg, "newest");
  EXPECT_EQ(newest->arrived_at, at(30));
  EXPECT_EQ(stream.dropped(), 1);
}

TEST(MjpegStream, BoundariesAsServersWriteThem) {
  for (const char* written : {"\"frame\"", "--frame", "frame; charset=x", " frame "}) {
    const std::string answer = fmt::format(
        "HTTP/1.0 200 OK\r\nContent-type: Multipart/x-mixed-replace;boundary={}\r\n\r\n", written);
    EXPECT_EQ(images(answer + mjpeg_part("one"), 4), std::vector<std::string>{"one"}) << written;
  }
}

TEST(MjpegStream, WhatIsWrongIsNamed) {
  expect_contains(problem_of("SSH-2.0-OpenSSH\r\n\r\n"), "SSH-2.0");
  expect_contains(problem_of("HTTP/1.0 404 Not Found\r\n\r\n"), "404 Not Found");
  expect_contains(problem_of("HTTP/1.0 401 Unauthorized\r\n\r\n"), "NAME:PASSWORD");
  expect_contains(problem_of("HTTP/1.1 302 Found\r\nLocation: http://there/\r\n\r\n"), "http://there/");
  expect_contains(problem_of("HTTP/1.0 200 OK\r\nContent-Type: text/html\r\n\r\n"), "text/html");
  expect_contains(problem_of("HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace\r\n\r\n"),
                  "boundary");
  expect_contains(problem_of(k_mjpeg_answer + "--other\r\n"), "found \"--other\"");
  expect_contains(problem_of(k_mjpeg_answer + "--frame\r\nContent-Length: 2\r\n\r\nabc\r\n"), "found \"c\"");
  expect_contains(problem_of(k_mjpeg_answer + "--frame\r\nContent-Type: text/plain\r\n\r\n"), "text/plain");
  expect_contains(problem_of(k_mjpeg_answer + "--frame\r\nContent-Length: many\r\n\r\n"), "many");
  expect_contains(problem_of(k_mjpeg_answer + mjpeg_part("one") + "--frame--\r\n"), "ended the stream");
  expect_contains(
      problem_of("HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n" + k_mjpeg_answer.substr(17) + "zz\r\n"),
      "zz");
}

TEST(MjpegStream, MemoryStaysBoundedWhateverIsSent) {
  const std::string many(40000, 'x');
  EXPECT_NE(problem_of(k_mjpeg_answer + "--frame\r\nContent-Length: 1001\r\n\r\n").find("at most 1000"),
            std::string::npos);
  EXPECT_NE(problem_of(k_mjpeg_answer + open_part(many)).find("at most 1000"), std::string::npos);
  EXPECT_NE(problem_of("HTTP/1.0 200 OK\r\nX: " + many).find("header"), std::string::npos);
  EXPECT_NE(problem_of(k_mjpeg_answer + many).find("boundary"), std::string::npos);
  EXPECT_NE(problem_of(k_mjpeg_answer + "--frame\r\nX: " + many).find("header"), std::string::npos);
}

TEST(MjpegStream, ImagesBeforeAFaultAreGood) {
  Status end;
  EXPECT_EQ(images(k_mjpeg_answer + mjpeg_part("good") + "--wrong\r\n", 500, &end),
            std::vector<std::string>{"good"});
  EXPECT_FALSE(end);
}

// Streams with random damage: every result is an image or an error.
TEST(MjpegStream, DamagedStreamsNeverBreakIt) {
  auto rng = test::test_rng();
  const std::string lengths =
      k_mjpeg_answer + mjpeg_part("first") + open_part("second") + mjpeg_part("third");
  const std::string chunks = "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n" + k_mjpeg_answer.substr(17) +
                             chunked(lengths.substr(k_mjpeg_answer.size()), 9);
  int refused = 0;
  for (int run = 0; run < 20000; ++run) {
    std::string bytes = run % 2 ? chunks : lengths;
    for (int i = 0; i < 1 + run % 4; ++i) {
      const std::size_t where = rng() % bytes.size();
      if (rng() % 3 == 0)
        bytes.erase(where, 1 + rng() % 9);
      else
        bytes[where] = "\r\n-:0f;=\xff"[rng() % 9];
    }
    Status end;
    for (const std::string& image : images(bytes, 1 + rng() % 64, &end))
      EXPECT_LE(image.size(), bytes.size());
    refused += end ? 0 : 1;
  }
  EXPECT_GT(refused, 5000);
}

}  // namespace
}  // namespace limn::device
