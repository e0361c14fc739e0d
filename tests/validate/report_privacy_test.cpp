#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "core/file.h"
#include "tests/support/matchers.h"
#include "validate/hardware_report/clean_folder.h"
#include "validate/hardware_report/image_metadata.h"
#include "validate/hardware_report/private_facts.h"
#include "validate/hardware_report/private_words.h"

namespace limn::validate {
namespace {

namespace fs = std::filesystem;

TEST(PrivateWords, AreReplacedWhereTheyStandAlone) {
  PrivateWords words;
  words.add("sam", "(user)");
  words.add("/home/sam", "(home)");
  words.add("workshop", "(machine)");
  words.add("21853478", "(serial)");
  words.add("p\"a<b", "(password)");
  EXPECT_EQ(words.without("Sam at WORKSHOP: /home/sam/rig, the same; sam_left"),
            "(user) at (machine): (home)/rig, the same; (user)_left");
  EXPECT_EQ(words.without("Basler-21853478 after 0.21853478 s, 121853478 ns, 21853478.5"),
            "Basler-(serial) after 0.21853478 s, 121853478 ns, 21853478.5");
  for (const char* form : {"p\"a<b", "p\\\"a<b", "p&quot;a&lt;b", "p%22a%3Cb"})
    EXPECT_EQ(words.without(form), "(password)") << form;
}

TEST(PrivateWords, WhatHasTheFormOfAnAddressIsReplaced) {
  const PrivateWords words;
  for (const auto& [text, expected] : std::map<std::string, std::string>{
           {"gige:192.168.7.20 00:11:22:aa:bb:cc", "gige:(address) (address)"},
           {"at fe80::1%eth0, 2001:db8::7. and ::ffff:10.0.0.1", "at (address), (address). and (address)"},
           {"gige:fe80::7", "gige:(address)"},
           {"mjpeg:http://cam.example.org:80/video", "mjpeg:http://(address)/video"},
           {"rtsp://admin:se/cret@203.0.113.9:554/s?user=a&password=b'c is silent",
            "rtsp://(address)/s is silent"},
           {"http://[2001:db8::7]:8080/x", "http://(address)/x"},
           {"cannot reach printer-3.local or nas.fritz.box.", "cannot reach (machine) or (machine)."},
           {"v4l2:/dev/v4l/by-id/usb-046d_HD_Webcam_A1B2C3D4-video-index0",
            "v4l2:/dev/v4l/by-id/usb-046d_HD_Webcam_(serial)-video-index0"},
           {"gige:Basler-acA1300-AB12CD", "gige:Basler-acA1300-(serial)"},
           {"serial number: AB12CD, Serial=0815", "serial number: (serial), Serial=(serial)"}})
    EXPECT_EQ(words.without(text), expected);
}

TEST(PrivateWords, VersionsNumbersAndTimesStay) {
  const PrivateWords words;
  for (const char* text :
       {"NVIDIA 535.183.1.2", "driver 10.18.13.5", "version 10.4.2.1", "23.1.0.2", "12345678901 frames",
        "1920x1080, 59.940000 Hz", "12:34:56", "2026-11-27T16:51:07Z", "xmlns='http://www.w3.org/2000/svg'",
        "std::sort", "charuco:11x8:25mm", "v4l2:/dev/video0", "6.18.44-fc-v657 x86_64", "0000:00:14.0",
        "~/.local/share/limn", "serial numbers are taken out", "LENSMODEL_OPENCV8", "a1b2c3d4e5f6a7b8"})
    EXPECT_EQ(words.without(text), text);
  // What looks like an address in the text of an image is none.
  const std::string image = "<img src='data:image/jpeg;base64,ab/10.0.0.1+sam/fe80==' alt='10.0.0.1'>";
  EXPECT_EQ(words.without(image),
            "<img src='data:image/jpeg;base64,ab/10.0.0.1+sam/fe80==' alt='(address)'>");
}

TEST(PrivateWords, FormsThatAreTooShortAreNotReplaced) {
  PrivateWords words;
  words.add("%20", "(path)");  // a blank
  EXPECT_EQ(words.without("a b c"), "a b c");
}

TEST(PrivateFacts, DevicesAddTheirAddressesLoginsAndSerialNumbers) {
  PrivateWords words;
  add_devices(
      &words,
      {.file = "/srv/geheim/devices.json",
       .cameras = {{.source = "http://samantha:pa/ss'w0rd@cam7.example.org:8080/geheim77/v?token=t0k3n"},
                   {.source = "gige:Basler-acA1300-21853478"},
                   {.source = "v4l2:/dev/v4l/by-id/usb-046d_C920_A1B2C3D4-video-index0"},
                   {.host = "workshop7", .source = "/srv/photographs/one.png"}}});
  for (const char* text : {"samantha", "pa/ss'w0rd", "cam7.example.org", "geheim77", "t0k3n", "21853478",
                           "A1B2C3D4", "workshop7", "/srv/geheim", "/srv/photographs"})
    EXPECT_TRUE(words.is_in(std::string("x ") + text + " y")) << text;
  for (const char* text : {"Basler", "acA1300", "C920", "046d", "http://", "one.png", "8080"})
    EXPECT_FALSE(words.is_in(text)) << text;
  EXPECT_EQ(words.without("gige:Basler-acA1300-21853478"), "gige:Basler-acA1300-(serial)");
}

TEST(PrivateFacts, TheMachineAddsItsNamesAndSerialNumbers) {
  const fs::path root = test::test_folder();
  for (const char* folder : {"etc", "sys/bus/usb/devices/1-1"}) fs::create_directories(root / folder);
  ASSERT_TRUE(write_file(root / "etc/hosts",
                         "127.0.0.1 localhost\n127.0.1.1 workshop7.example.net workshop7 # us\n"));
  ASSERT_TRUE(write_file(root / "etc/resolv.conf", "search corp.example.com\nnameserver 203.0.113.1\n"));
  ASSERT_TRUE(write_file(root / "etc/machine-id", "0123456789abcdef0123456789abcdef\n"));
  ASSERT_TRUE(write_file(root / "sys/bus/usb/devices/1-1/serial", "A1B2C3D4\n"));
  PrivateWords words;
  add_machine(&words, root);
  for (const char* text : {"workshop7.example.net", "workshop7", "corp.example.com", "203.0.113.1",
                           "A1B2C3D4", "0123456789abcdef0123456789abcdef"})
    EXPECT_TRUE(words.is_in(text)) << text;
  EXPECT_FALSE(words.is_in("localhost"));
}

TEST(CleanFolder, TakesPrivateWordsOutOfAllFilesAndRemovesWhatIsNotNeeded) {
  const fs::path folder = test::test_folder() / "live";
  fs::create_directories(folder / "scene/looks");
  PrivateWords words;
  words.add("samantha", "(user)");
  const std::string jsonl = "{\"who\":\"samantha\",\"at_ns\":123456789012}\n{\"mm\":0.1234567890123}\n";
  for (const auto& [file, text] :
       std::map<std::string, std::string>{{"events.jsonl", jsonl},
                                          {"poses.csv", "at_s,who\n1234567.5,samantha\n"},
                                          {"session.html", "<p>samantha</p>"},
                                          {"scene/scene.json", "// by samantha\n{}\n"},
                                          {"scene/door.glb", "samantha"},
                                          {"scene/comments.json", "{}"},
                                          {"scene/pairings.json", "{}"},
                                          {"scene/drawn.json", "{}"},
                                          {"scene/looks/a.json", "{}"},
                                          {"authority.pem", "key"}})
    ASSERT_TRUE(write_file(folder / file, text));
  fs::create_symlink("/etc/passwd", folder / "link.json");
  ASSERT_TRUE(remove_unneeded(folder));
  ASSERT_TRUE(clean_folder(folder, words));
  EXPECT_EQ(read_file(folder / "events.jsonl").value(),
            "{\"who\":\"(user)\",\"at_ns\":123456789012}\n{\"mm\":0.1234567890123}\n");
  EXPECT_EQ(read_file(folder / "poses.csv").value(), "at_s,who\n1234567.5,(user)\n");
  EXPECT_EQ(read_file(folder / "session.html").value(), "<p>(user)</p>");
  EXPECT_EQ(read_file(folder / "scene/scene.json").value(), "// by (user)\n{}\n");
  for (const char* file : {"scene/comments.json", "scene/pairings.json", "scene/drawn.json", "scene/looks",
                           "authority.pem", "link.json"})
    EXPECT_FALSE(fs::exists(fs::symlink_status(folder / file))) << file;
  EXPECT_TRUE(fs::exists(folder / "scene/door.glb"));
}

TEST(CleanFolder, KeepsKeysAndNumbersOfJsonFiles) {
  const fs::path folder = test::test_folder();
  PrivateWords words;
  words.add("green", "(user)");
  words.add("12345678", "(serial)");
  ASSERT_TRUE(write_file(folder / "a.json", R"({"green": 12345678, "who": "green 12345678"})"));
  ASSERT_TRUE(write_file(folder / "b.jsonl", "{\"green\":12345678}\n{\"who\":\"Green\"}\n{\"mm\":1.50}\n"));
  ASSERT_TRUE(write_file(folder / "same.json", "{ \"green\":12345678 }"));
  ASSERT_TRUE(write_file(folder / "damaged.JPG", "\xFF\xD8 by green"));
  ASSERT_TRUE(clean_folder(folder, words));
  EXPECT_EQ(nlohmann::json::parse(read_file(folder / "a.json").value()),
            nlohmann::json({{"green", 12345678}, {"who", "(user) (serial)"}}));
  EXPECT_EQ(read_file(folder / "b.jsonl").value(),
            "{\"green\":12345678}\n{\"who\":\"(user)\"}\n{\"mm\":1.50}\n");
  EXPECT_EQ(read_file(folder / "same.json").value(), "{ \"green\":12345678 }");
  EXPECT_FALSE(fs::exists(folder / "damaged.JPG"));
}

TEST(ImageMetadata, AJpegLosesCommentsAndExifAndKeepsItsPixels) {
  const auto segment = [](char marker, const std::string& content) {
    const auto length = static_cast<char>(content.size() + 2);
    return std::string("\xFF") + marker + '\0' + length + content;
  };
  const std::string start = "\xFF\xD8", jfif = segment('\xE0', "JFIF"),
                    exif = segment('\xE1', "Exif samantha"), comment = segment('\xFE', "by samantha"),
                    adobe = segment('\xEE', "Adobe"), table = segment('\xDB', "quantization"),
                    pixels = segment('\xDA', "scan") + "pixels\xFF\xD9";
  EXPECT_EQ(without_metadata(start + jfif + exif + comment + adobe + table + pixels + "samantha").value(),
            start + jfif + adobe + table + pixels);
  EXPECT_EQ(without_metadata(start + jfif + table + pixels).value(), std::nullopt);
  // Several scans with a comment between them, and another image behind the first (MPO).
  const std::string scan = segment('\xDA', "scan") + std::string(
                                                         "a\xFF\x00"
                                                         "b\xFF\xD0"
                                                         "c\xFF",
                                                         7);
  const std::string end = "\xFF\xD9";
  EXPECT_EQ(without_metadata(start + scan + comment + scan + end + start + exif + pixels).value(),
            start + scan + scan + end);
  EXPECT_EQ(without_metadata(start + scan + scan + end).value(), std::nullopt);
  EXPECT_FALSE(without_metadata(start + scan + "samantha"));  // without an end
  EXPECT_FALSE(without_metadata("no image"));
  EXPECT_FALSE(without_metadata(start + exif.substr(0, 8)));  // truncated
}

}  // namespace
}  // namespace limn::validate
