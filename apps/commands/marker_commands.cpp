#include <CLI/CLI.hpp>
#include <memory>

#include "apps/commands/commands.h"
#include "apps/commands/options.h"
#include "apps/detect.h"
#include "apps/detect_balls.h"
#include "apps/learn_body.h"
#include "apps/learn_constellation.h"
#include "apps/markers.h"

namespace limn::apps {

void add_markers(CLI::App& app, Run& run) {
  auto* command = app.add_subcommand(
      "markers", "Make sheets of markers, a calibration board or a marker holder to print in true size");
  command->footer(
      "Example: limn markers --family aruco_4x4_50 --ids 0-11 --size-mm 40 --out sheet.pdf\n"
      "Example: limn markers --board charuco:11x8:25mm --out board.pdf\n"
      "Example: limn markers --size-mm 40 --mount holder.stl   (a 3D-printable holder, its pose in "
      "holder.json)\n"
      "Example: limn markers --learn-body photos/*.jpg --camera camera0.cameramodel --family aruco_4x4_50 "
      "--size-mm 40 --out body.json\n"
      "Example: limn markers --learn-constellation photos/*.jpg --camera camera0.cameramodel --ball-mm 40 "
      "--out wand.json\n"
      "Example: limn markers --train photo.jpg --out logo.patt\n"
      "Example: limn markers --compare logo.patt hiro.patt");
  auto options = std::make_shared<MarkersOptions>();
  auto learning = std::make_shared<LearnBodyOptions>();
  command
      ->add_option(
          "--family", options->family,
          "Marker family, such as apriltag_36h11, apriltag_41h12, artoolkit_3x3 or artoolkit:hiro.patt; "
          "white on black with _inverted: aruco_4x4_50_inverted")
      ->type_name("FAMILY")
      ->capture_default_str();
  command->add_option("--ids", options->ids, "Numbers of the markers, such as 0-11,15")
      ->type_name("NUMBERS")
      ->capture_default_str();
  command->add_option("--size-mm", options->size_mm, "Side of the marker's square in mm")
      ->capture_default_str();
  command
      ->add_option("--board", options->board,
                   "Make a calibration board instead of markers, such as charuco:11x8:25mm, "
                   "chessboard:9x7:75mm or aprilgrid:6x6:88mm:0.3")
      ->type_name("BOARD");
  auto* learn = command
                    ->add_option("--learn-body", learning->images,
                                 "Instead of a sheet: measure from these photographs where the markers of a "
                                 "rigid body are on it")
                    ->type_name("IMAGE");
  command
      ->add_option(
          "--camera", learning->camera,
          "With --learn-body and --learn-constellation: camera file (.cameramodel or another format)")
      ->type_name("FILE");
  auto balls = std::make_shared<LearnConstellationOptions>();
  auto* learn_balls =
      command
          ->add_option("--learn-constellation", balls->images,
                       "Instead of a sheet: measure from these photographs where the balls of a "
                       "rigid body are on it")
          ->type_name("IMAGE")
          ->excludes(learn);
  command->add_option("--ball-mm", balls->ball_mm, "With --learn-constellation: diameter of the balls in mm")
      ->needs(learn_balls)
      ->capture_default_str();
  add_choice(command, "--shade", &balls->shade, tracker::k_ball_shades,
             "With --learn-constellation: whether the balls are brighter or darker than what is around them")
      ->needs(learn_balls);
  add_choice(command, "--encoding", &balls->encoding, tracker::k_encodings,
             "With --learn-constellation: encoding of grey levels: linear (proportional to light) or srgb "
             "(webcams, photographs)")
      ->needs(learn_balls);
  command
      ->add_option("--others", balls->others,
                   "With --learn-constellation: constellation files that the new one must differ from")
      ->type_name("FILE.json")
      ->needs(learn_balls);
  auto* train = command
                    ->add_option("--train", options->train,
                                 "Instead of a sheet: make a template from the one black frame in this image")
                    ->type_name("IMAGE");
  command
      ->add_option("--pattern-ratio", options->pattern_ratio,
                   "With --train: width of the frame's inside as share of the frame's (AR.js: patternRatio)")
      ->needs(train)
      ->capture_default_str();
  auto* compare =
      command
          ->add_option("--compare", options->compare,
                       "Instead of a sheet: measure how well these templates can be distinguished")
          ->type_name("FILE.patt");
  command->add_option("--json", options->json, "With --compare: file for the report")
      ->type_name("FILE.json")
      ->needs(compare);
  compare->excludes(train);
  auto* mount = command
                    ->add_option("--mount", options->mount,
                                 "Make a 3D-printable holder (.stl, in mm) for a marker of --size-mm and "
                                 "write its pose beside it; with --out also make the sheet")
                    ->type_name("FILE.stl");
  command->add_option("--paper-mm", options->paper_mm, "With --mount: thickness of paper and glue in mm")
      ->needs(mount)
      ->capture_default_str();
  command
      ->add_option(
          "--out", options->out,
          "File to write: .pdf or .svg, for a board also .png, for a body .json, for a template .patt")
      ->type_name("FILE");
  command->callback([options, learning, balls, &run] {
    run = [options, learning, balls] {
      if (!balls->images.empty()) {
        balls->camera = learning->camera;
        balls->out = options->out;
        return report_result(run_learn_constellation(*balls));
      }
      if (learning->images.empty() && !learning->camera.empty())
        return report_result(
            usage_error("--camera: expected --learn-body or --learn-constellation with it."));
      if (learning->images.empty()) return report_result(run_markers(*options));
      learning->family = options->family;
      learning->size_mm = options->size_mm;
      learning->out = options->out;
      return report_result(run_learn_body(*learning));
    };
  });
}

void add_detect(CLI::App& app, Run& run) {
  auto* command =
      app.add_subcommand("detect", "Find markers, or constellations of balls, and their poses in images");
  command->footer(
      "Example: limn detect photo.jpg --family aruco_6x6_250 --camera camera0.cameramodel --size-mm 40 "
      "--draw out\n"
      "Example: limn detect photo.jpg --constellation wand.json --camera camera0.cameramodel");
  auto options = std::make_shared<DetectOptions>();
  command
      ->add_option(
          "images", options->images,
          "Images: PNG, JPEG, PGM, PPM, BMP, TIFF, WebP or TGA, rows as stored (an EXIF orientation is "
          "ignored)")
      ->type_name("IMAGE")
      ->required();
  command
      ->add_option(
          "--family", options->families,
          "Marker families to look for, separated by commas; white markers on black with _inverted, such as "
          "aruco_4x4_50_inverted; templates with another pattern ratio than 0.5 as "
          "artoolkit:logo.patt@0.8")
      ->type_name("FAMILY")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--camera", options->camera,
                   "Camera file of mrcal, OpenCV, ROS, Kalibr, PhotonVision, ORB-SLAM or ARToolKit; "
                   "FILE:NAME for one of several")
      ->type_name("FILE");
  command->add_option("--size-mm", options->size_mm,
                      "Side of the black square in mm; with --camera it gives poses");
  add_choice(command, "--pose", &options->pose, k_pose_methods,
             "How poses are computed: ippe, or triangle (the method of the 2011 paper)");
  add_choice(command, "--encoding", &options->encoding, tracker::k_encodings,
             "Encoding of grey levels: linear (proportional to light) or srgb (webcams, photographs)");
  command->add_option("--csv", options->csv, "CSV file to write, one row for each marker")
      ->type_name("FILE.csv");
  command->add_option("--json", options->json, "JSON file to write: corners, poses, covariances")
      ->type_name("FILE.json");
  command->add_option("--draw", options->draw, "Folder for copies of the images with the markers drawn in")
      ->type_name("FOLDER");
  command
      ->add_option("--threads", options->threads,
                   "Number of images to process at the same time; with one image or --repeat, number of "
                   "threads for an image")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  command
      ->add_option("--repeat", options->repeat,
                   "Also measure the median time in ms of N detections in memory (0: do not)")
      ->check(CLI::Range(0, 1000000));
  auto balls = std::make_shared<DetectBallsOptions>();
  auto* constellation =
      command
          ->add_option("--constellation", balls->constellations,
                       "Find these constellations of balls instead of markers (files of limn markers "
                       "--learn-constellation), separated by commas")
          ->type_name("FILE.json")
          ->delimiter(',');
  for (const char* other : {"--family", "--size-mm", "--pose", "--csv", "--draw", "--threads", "--repeat"})
    constellation->excludes(command->get_option(other));
  add_choice(command, "--shade", &balls->shade, tracker::k_ball_shades,
             "With --constellation: whether the balls are brighter or darker than what is around them")
      ->needs(constellation);
  command->callback([options, balls, &run] {
    run = [options, balls] {
      if (balls->constellations.empty()) return report_result(run_detect(*options));
      balls->images = options->images;
      balls->camera = options->camera;
      balls->encoding = options->encoding;
      balls->json = options->json;
      return report_result(run_detect_balls(*balls));
    };
  });
}

}  // namespace limn::apps
