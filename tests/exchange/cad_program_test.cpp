// limn-cad as a child process: its limits, its ends, and what is kept of a CAD file.
#include "scene/files/cad_program.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

#include "core/file.h"
#include "exchange/cad_import.h"
#include "scene/meshes/cad_file.h"
#include "scene/meshes/mesh.h"
#include "scene/part_units.h"
#include "scene/scene.h"
#include "tests/exchange/cad_folder.h"

namespace limn {
namespace {

namespace fs = std::filesystem;
using test::box_file;
using test::Cad;
using test::size_of;

// ---- scenes and the cache

TEST_F(Cad, ASlotsFolderTakesAStepFile) {
  fs::create_directories(folder / "slots" / "mirror");
  write("a.step", box_file("mm", "AUTOMOTIVE_DESIGN"));
  write("slots/mirror/b.STEP", box_file("inch", "CONFIG_CONTROL_DESIGN"));
  write("scene.json",
        R"({"schema": "limn.scene/1", "prototype": {"mesh": "a.step"}, "slots": [{"name": "mirror",
    "marker": "aruco_4x4_50:1", "size_mm": 40, "marker_from_part": {"rotation_wxyz": [1,0,0,0], "translation_m": [0,0,0]},
    "variants": [{"name": "a", "mesh": "a.step"}]}]})");
  for (const char* reading : {"by limn-cad", "from what it kept"}) {
    std::vector<scene::SkippedVariant> skipped;
    const auto scene = scene::load_scene(folder, &skipped);
    ASSERT_TRUE(scene) << reading << ": " << scene.message();
    EXPECT_TRUE(skipped.empty()) << reading << ": " << to_text(skipped[0]);
    ASSERT_EQ(scene->slots[0].variants.size(), 2u) << reading;
    EXPECT_EQ(scene->slots[0].variants[1].name, "b");
    EXPECT_EQ(units_question(scene->slots[0], scene->slots[0].variants[1]), "");
    setenv("LIMN_CAD", "/nowhere", 1);
  }
  unsetenv("LIMN_CAD");
}

TEST_F(Cad, WhatWasKeptIsMadeAgainWhenTheFileChanges) {
  const fs::path file = write("box.step", box_file("mm", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 0.1, 1e-5);
  const fs::path kept = folder / ".box.step.glb";
  ASSERT_TRUE(fs::exists(kept));
  EXPECT_TRUE(scene::is_cad_cache_name(kept));
  EXPECT_FALSE(scene::is_cad_cache_name("box.step.glb"));
  const auto first = fs::last_write_time(kept);
  load(file);
  EXPECT_EQ(fs::last_write_time(kept), first) << "it was read again without need";
  write("box.step", box_file("m", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 100, 1e-2);
  const auto other = scene::cad_as_glb(file, {.chord_mm = 0.5});
  ASSERT_TRUE(other);
  EXPECT_NE(fs::last_write_time(kept), first);
}

TEST_F(Cad, AKeptGlbThatIsDamagedOrOfAnotherVersionIsMadeAgain) {
  const fs::path file = write("box.step", box_file("mm", "AUTOMOTIVE_DESIGN")),
                 kept = folder / ".box.step.glb";
  load(file);
  const std::string whole = read_file(kept).value();
  ASSERT_TRUE(write_file(kept, whole.substr(0, whole.size() - 40)));
  EXPECT_EQ(load(file).triangles.size(), 12u);
  EXPECT_EQ(read_file(kept).value(), whole);
  std::string damaged = whole;  // of the right length, but no views of its buffer
  const std::size_t views = damaged.find("\"bufferViews\"");
  ASSERT_NE(views, std::string::npos);
  damaged.replace(views, 13, "\"bufferVoids\"");
  ASSERT_TRUE(write_file(kept, damaged));
  load(file);
  EXPECT_EQ(read_file(kept).value(), whole);
  std::string old = whole;
  const std::size_t at = old.find("\"format\":");
  ASSERT_NE(at, std::string::npos);
  old[at + 9] = '1';
  ASSERT_TRUE(write_file(kept, old));
  load(file);
  EXPECT_EQ(read_file(kept).value(), whole);
}

TEST_F(Cad, AGivenUnitReplacesTheFiles) {
  const fs::path file = write("box.step", box_file("inch", "AUTOMOTIVE_DESIGN"));
  EXPECT_NEAR(size_of(load(file)).x(), 2.54, 1e-4);
  EXPECT_NEAR(size_of(load(file, scene::LengthUnit::millimetre)).x(), 0.1, 1e-5);
}

// A program that stands for limn-cad.
class OtherCad : public Cad {
 protected:
  void replace(const std::string& script) const {
    ASSERT_TRUE(write_file(folder / "other-cad", "#!/bin/bash\n" + script + "\n"));
    fs::permissions(folder / "other-cad", fs::perms::owner_all);
    setenv("LIMN_CAD", (folder / "other-cad").c_str(), 1);
  }
  std::string refusal_of(const scene::CadLimits& limits, const std::stop_token& stop = {}) const {
    const auto report = scene::run_limn_cad(folder / "a.step", {}, limits, stop);
    return report ? "" : report.message();
  }
  void TearDown() override { unsetenv("LIMN_CAD"); }
};

TEST_F(OtherCad, WithoutTheProgramAMessageSaysWhatToInstall) {
  setenv("LIMN_CAD", "/nowhere/limn-cad", 1);
  const std::string text = refusal(write("box.step", box_file("mm", "AUTOMOTIVE_DESIGN")));
  EXPECT_NE(text.find("apt install limn-cad"), std::string::npos) << text;
}

TEST_F(OtherCad, AProgramThatHangsIsEnded) {
  replace("echo $$ > '" + (folder / "pid").string() + "'; exec sleep 100");
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_NE(refusal_of({.seconds = 30, .silent_seconds = 0.5}).find("within 0.5 s at each step"),
            std::string::npos)
      << refusal_of({.seconds = 30, .silent_seconds = 0.5});
  EXPECT_NE(refusal_of({.seconds = 1, .silent_seconds = 30}).find("within 1 s, found"), std::string::npos);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(20));
  const auto pid = read_file(folder / "pid");
  ASSERT_TRUE(pid);
  EXPECT_FALSE(fs::exists("/proc/" + std::to_string(std::stoi(*pid)))) << "it still runs";
}

TEST_F(OtherCad, AProgramThatClosesItsOutputAndGoesOnIsEnded) {
  replace("exec >&- 2>&-; exec sleep 100");
  EXPECT_NE(refusal_of({.seconds = 0.5}).find("within 0.5 s, found"), std::string::npos);
}

TEST_F(OtherCad, ATimeThatItWaitedIsNotKeptAgainstAFile) {
  const fs::path file = write("slow.step", "one");
  replace("exec sleep 100");
  EXPECT_FALSE(scene::try_limn_cad(file, {}, {.seconds = 0.3}).fails_again);
  replace("while true; do :; done");
  EXPECT_FALSE(scene::try_limn_cad(file, {}, {.seconds = 0.3}).report);
}

TEST_F(OtherCad, ProgressKeepsItAlive) {
  replace("for i in 1 2 3 4; do echo \"progress $i reading\"; sleep 0.3; done; echo '{}'");
  const auto report = scene::run_limn_cad(folder / "a.step", {}, {.seconds = 30, .silent_seconds = 0.9});
  ASSERT_TRUE(report) << report.message();
  EXPECT_EQ(*report, "{}\n");
}

TEST_F(OtherCad, CrashesMemoryAndMessagesBecomeOneSentence) {
  replace("kill -SEGV $$");
  EXPECT_NE(refusal_of({}).find("limn-cad crashes (Segmentation fault)"), std::string::npos);
  replace("echo noise >&2; printf 'limn-cad: a.step: it is \\001bad.\\n' >&2; exit 1");
  EXPECT_EQ(refusal_of({}), "a.step: it is bad.");
  replace("exit 3");
  EXPECT_NE(refusal_of({}).find("needs more"), std::string::npos);
  // The limit is set when the program already runs.
  replace("for i in {1..100}; do [ $(ulimit -v) = unlimited ] || break; sleep 0.05; done; ulimit -v");
  const auto limit = scene::run_limn_cad(folder / "a.step", {}, {.memory_mb = 512});
  ASSERT_TRUE(limit);
  EXPECT_EQ(*limit, "524288\n");
}

TEST_F(OtherCad, AFileThatFailedIsNotTriedAgainUntilItChanges) {
  const fs::path count = folder / "count";
  replace("echo x >> '" + count.string() + "'; echo 'limn-cad: it is bad' >&2; exit 1");
  const fs::path file = write("bad.step", "one");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(refusal(file), "it is bad");
  EXPECT_EQ(read_file(count).value(), "x\n");
  write("bad.step", "two");
  EXPECT_EQ(refusal(file), "it is bad");
  EXPECT_EQ(read_file(count).value(), "x\nx\n");
}

TEST_F(OtherCad, WhatIsNotTheFilesFaultIsTriedAgain) {
  const fs::path file = write("good.step", "one"), failed = folder / ".good.step.failed";
  const auto leaves_nothing = [&](const char* script, const char* part) {
    replace(script);
    const std::string text = refusal(file);
    EXPECT_NE(text.find(part), std::string::npos) << text;
    EXPECT_FALSE(fs::exists(failed)) << script;
  };
  leaves_nothing("echo 'limn-cad: out.glb: the disk is full' >&2; exit 4", "the disk is full");
  leaves_nothing("kill -TERM $$", "ended from outside (Terminated)");
  leaves_nothing("exit 127", "exit code 127");
  ASSERT_TRUE(write_file(folder / "other-cad", "#!/nowhere/interpreter\n"));  // does not start
  fs::permissions(folder / "other-cad", fs::perms::owner_all);
  EXPECT_NE(refusal(file).find("good.step: expected that the program limn-cad starts"), std::string::npos);
  EXPECT_FALSE(fs::exists(failed));
  replace("kill -SEGV $$");
  refusal(file);
  EXPECT_TRUE(fs::exists(failed)) << "a crash comes again";
}

TEST_F(OtherCad, AnExceededLimitIsNamedWithTheOptionThatRaisesIt) {
  replace("exec sleep 100");
  exchange::CadImportOptions options{.file = folder / "hammer.iges", .out = folder / "hammer.glb"};
  write("hammer.iges", "a file");
  ASSERT_TRUE(write_file(options.out, "the old part"));
  options.minutes = 0.01;
  const std::string text = exchange::import_cad(options).message();
  EXPECT_NE(text.find("hammer.iges: expected a CAD file that is read within 0.12 s at each step"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("--minutes"), std::string::npos) << text;
  EXPECT_EQ(read_file(options.out).value(), "the old part");
}

TEST_F(OtherCad, TheEndOfASessionEndsIt) {
  replace("exec sleep 100");
  std::stop_source stop;
  stop.request_stop();
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_NE(refusal_of({}, stop.get_token()).find("the session's end"), std::string::npos);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(5));
}

}  // namespace
}  // namespace limn
