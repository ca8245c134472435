// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/camera_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

const std::string kCamera = "fx: 517.3\nfy: 516.5\ncx: 318.6\ncy: 255.3\nwidth: 640\nheight: 480\ndepth_factor: 5000\n";

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

std::string parse_message(const std::string& text) {
  return test::input_error_of([&] { parse_camera(text, "camera.yaml"); });
}

TEST(CameraFile, ReadsRequiredAndOptionalKeys) {
  const CameraModel c = parse_camera(kCamera + "k1: -0.05\r\nfps: 15 # slow\ndepth_max: 4\n", "camera.yaml");
  EXPECT_EQ(c.fx, 517.3);
  EXPECT_EQ(c.cy, 255.3);
  EXPECT_EQ(c.width, 640);
  EXPECT_EQ(c.depth_factor, 5000);
  EXPECT_EQ(c.k1, -0.05);
  EXPECT_EQ(c.k2, 0);
  EXPECT_EQ(c.fps, 15);
  EXPECT_EQ(c.depth_max, 4);
  EXPECT_EQ(c.depth_time_offset, 0);
}

TEST(CameraFile, DepthMayShowWhatWasBeforeItsStamp) {
  EXPECT_EQ(parse_camera(kCamera + "depth_time_offset: -0.018\n", "camera.yaml").depth_time_offset, -0.018);
  EXPECT_EQ(parse_camera(parse_camera(kCamera + "depth_time_offset: 0.01\n", "c").to_yaml(), "c").depth_time_offset,
            0.01);
  EXPECT_NE(parse_message(kCamera + "depth_time_offset: -18\n").find("depth_time_offset"), std::string::npos);
  EXPECT_EQ(builtin_camera("fr1")->depth_time_offset, -0.018);
  EXPECT_EQ(builtin_camera("bonn")->depth_time_offset, 0);
}

// As camera_calibration of ROS writes it.
const std::string kRos =
    "image_width: 640\nimage_height: 480\ncamera_name: head_camera\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
    "  data: [517.25, 0., 318.5, 0., 516.5, 255.25, 0., 0., 1.]\ndistortion_model: plumb_bob\n"
    "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.05, 0.02, 0.001, -0.002, 0.003]\n"
    "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
    "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [510, 0, 318, 0, 0, 511, 255, 0, 0, 0, 1, 0]\n";
// As OpenCV's calibration sample writes it.
const std::string kOpenCv =
    "%YAML:1.0\n---\ncalibration_time: \"Fri 27 Nov 2026\"\nnframes: 20\nimage_width: 640\nimage_height: 480\n"
    "camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.1725e+02, 0., 3.185e+02, 0.,\n"
    "       516.5, 255.25, 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 8\n   cols: 1\n   dt: d\n"
    "   data: [ 0.1, 0.02, 0.001, -0.002, 0.003, 0.04, 0.05, 0.006 ]\navg_reprojection_error: 2.5e-01\n";

TEST(CameraFile, ReadsCalibrationsOfRosAndOpenCv) {
  const Camera ros = parse_camera(kRos, "c");
  EXPECT_EQ(ros.fx, 517.25);
  EXPECT_EQ(ros.fy, 516.5);
  EXPECT_EQ(ros.cx, 318.5);
  EXPECT_EQ(ros.cy, 255.25);
  EXPECT_EQ(ros.width, 640);
  EXPECT_EQ(ros.depth_factor, 1000) << "millimetres, as ROS has it";
  EXPECT_EQ(ros.k1, -0.05);
  EXPECT_EQ(ros.p1, 0.001);
  EXPECT_EQ(ros.k3, 0.003);
  const Camera opencv = parse_camera(kOpenCv + "depth_factor: 5000\nfps: 15\n", "c");
  EXPECT_EQ(opencv.fx, 517.25);
  EXPECT_EQ(opencv.k6, 0.006);
  EXPECT_EQ(opencv.depth_factor, 5000);
  EXPECT_EQ(opencv.fps, 15);
  const std::string flow =
      "image_width: 640\nimage_height: 480\ncamera_matrix: {rows: 3, cols: 3, data: [517, 0, 318, "
      "0, 516, 255, 0, 0, 1]}\n";
  EXPECT_EQ(parse_camera(flow, "c").fy, 516) << "a lens without distortion";
}

TEST(CameraFile, WhatIsWrongWithACalibrationIsNamed) {
  EXPECT_EQ(parse_message(replaced(kRos, "image_height: 480\n", "")),
            "camera.yaml: key \"image_height\" is missing; a calibration needs image_width, image_height and "
            "camera_matrix");
  EXPECT_EQ(parse_message(replaced(kRos, "image_width: 640", "image_width: 640.5")),
            "camera.yaml:1: image_width: \"640.5\" is not a whole number");
  EXPECT_EQ(parse_message(replaced(kRos, "image_width: 640", "image_width: 15")),
            "camera.yaml:1: image_width: 15 is out of range; it must be 16 ... 16384");
  EXPECT_EQ(parse_message(replaced(kRos, "distortion_model", "distorsion_model")),
            "camera.yaml:8: unknown key \"distorsion_model\" (did you mean \"distortion_model\"?)");
  EXPECT_EQ(parse_message(replaced(kRos, "plumb_bob", "equidistant")),
            "camera.yaml:9: distortion_coefficients: its distortion model equidistant is none of ours (plumb_bob, "
            "rational_polynomial); rectify the images, and give the camera of those");
  EXPECT_EQ(parse_message(replaced(kRos, "517.25, 0.,", "517.25, 0.5,")),
            "camera.yaml:4: camera_matrix: must be fx, 0, cx, 0, fy, cy, 0, 0, 1, by rows");
  EXPECT_EQ(parse_message(replaced(kRos, "517.25, ", "")),
            "camera.yaml:4: camera_matrix: holds 8 numbers, and its rows and cols say 9");
  EXPECT_EQ(parse_message(replaced(kRos, "517.25", "x")), "camera.yaml:7: camera_matrix.data: \"x\" is not a number");
  EXPECT_EQ(parse_message(replaced(kRos, "517.25", "0.")),
            "camera.yaml: fx: 0.000000 is out of range; it must be greater than 0 px");
  EXPECT_EQ(parse_message(replaced(kRos, "data: [517.25", "dada: [517.25")),
            "camera.yaml:4: key \"camera_matrix.data\" is missing; a matrix has rows, cols and data");
  EXPECT_EQ(parse_message(kRos + "fps: -3\n").substr(0, 23), "camera.yaml:21: fps: -3");
  EXPECT_EQ(parse_message(replaced(kRos, "cols: 5", "cols: 4")),
            "camera.yaml:9: distortion_coefficients: holds 5 numbers, and its rows and cols say 4");
  EXPECT_EQ(parse_message(kRos + "fx: 3\n"),
            "camera.yaml:21: fx: a camera file has either camera_matrix or fx, fy, cx and cy; leave one out");
  EXPECT_EQ(parse_message(kRos + "image_width: 3\n"), "camera.yaml:21: image_width: is given twice; leave one out");
  EXPECT_EQ(parse_message("image_width: [\n").substr(0, 33), "camera.yaml:2: is not valid YAML ");
}

TEST(CameraFile, StrangeNumbersAreDoubted) {
  const auto doubt = [](const std::string& text) { return doubt_of(parse_camera(text, "c"), "c"); };
  EXPECT_EQ(doubt(kCamera), "");
  EXPECT_EQ(doubt(replaced(kCamera, "fx: 517.3", "fx: 775")).find("c: fx 775 and fy 516.5 are far apart"), 0u);
  EXPECT_EQ(doubt(replaced(kCamera, "fx: 517.3", "fx: 774")), "");
  // 320 px of 27 px: 85.2 degrees to each side.
  const std::string wide = replaced(replaced(kCamera, "517.3", "27"), "516.5", "27");
  EXPECT_NE(doubt(wide).find("wider than 170 degrees"), std::string::npos) << doubt(wide);
}

TEST(CameraFile, MessagesSayWhereWhatAndWhatToDo) {
  EXPECT_EQ(parse_message(replaced(kCamera, "depth_factor", "depth_factr")),
            "camera.yaml:7: unknown key \"depth_factr\" (did you mean \"depth_factor\"?)");
  EXPECT_EQ(parse_message(replaced(kCamera, "517.3", "-517.3")),
            "camera.yaml:1: fx: -517.300000 is out of range; it must be greater than 0 px");
  EXPECT_EQ(parse_message(replaced(kCamera, "cx: 318.6\n", "")),
            "camera.yaml: key \"cx\" is missing; a camera file needs fx, fy, cx, cy, width, height, depth_factor");
  EXPECT_EQ(parse_message(replaced(kCamera, "640", "640.5")), "camera.yaml:5: width: \"640.5\" is not a whole number");
  EXPECT_EQ(parse_message(kCamera + "fx: 3\n"), "camera.yaml:8: fx: is given twice; leave one out");
  EXPECT_EQ(parse_message("{{{").substr(0, 32), "camera.yaml:1: is not valid YAML");
  EXPECT_NE(parse_message(std::string("fx: 1\0", 6)), "no error");
}

TEST(CameraFile, AMaskIsAnImageBesideTheFile) {
  const test::TempFolder folder;
  GreyImage mask(640, 480);
  mask(3, 2) = 1;
  write_file_atomically(folder / "body.png", encode_png(mask));
  write_file_atomically(folder / "small.png", encode_png(GreyImage(64, 48)));
  write_file_atomically(folder / "all.png", encode_png(GreyImage(640, 480, 9)));
  const auto parse = [&](const std::string& line) { return parse_camera(kCamera + line, folder / "camera.yaml"); };
  const CameraModel camera = parse("mask: body.png\n");
  ASSERT_NE(camera.mask, nullptr);
  EXPECT_EQ((*camera.mask)(3, 2), 255);
  EXPECT_EQ(std::count(camera.mask->data(), camera.mask->data() + camera.mask->size(), 0), 640 * 480 - 1);
  EXPECT_EQ(parse("").mask, nullptr);
  EXPECT_NE(parse_camera(kRos + "mask: body.png\n", folder / "camera.yaml").mask, nullptr);
  const auto refusal = [&](const std::string& line) { return test::input_error_of([&] { parse(line); }); };
  for (const auto& [line, words] : {std::pair{"mask: none.png\n", "camera.yaml:8: mask: "},
                                    {"mask: none.png\n", "none.png"},
                                    {"mask:\n", "no value"},
                                    {"mask: camera.yaml\n", "mask: "},
                                    {"mask: small.png\n", "64 x 48 px is out of range; it must be of the size"},
                                    {"mask: all.png\n", "it must be 0 where the images show the world"}})
    EXPECT_NE(refusal(line).find(words), std::string::npos) << refusal(line);
}

TEST(CameraFile, WrittenCameraReadsBackTheSame) {
  for (const char* name : {"fr1", "fr2", "fr3", "bonn"}) {
    const CameraModel c = *builtin_camera(name), back = parse_camera(c.to_yaml(), "camera.yaml");
    EXPECT_EQ(back.to_yaml(), c.to_yaml());
    EXPECT_EQ(back.k3, c.k3);
  }
}

TEST(CameraFile, FilesInConfigAreTheBuiltInCameras) {
  for (const char* name : {"fr1", "fr2", "fr3", "bonn"}) {
    const CameraModel file = Camera::load(fs::path(DKB_CONFIG) / ("camera_" + std::string(name) + ".yaml"));
    EXPECT_EQ(file.to_yaml(), builtin_camera(name)->to_yaml()) << name;
  }
}

class ChooseCamera : public testing::Test {
 protected:
  ChooseCamera() : root(fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_choose_camera")) {
    fs::remove_all(root);
  }
  ~ChooseCamera() override { fs::remove_all(root); }
  fs::path folder(const std::string& name) const {
    fs::create_directories(root / name);
    return root / name;
  }
  const fs::path root;
};

TEST_F(ChooseCamera, PrefersOptionThenFileThenFolderName) {
  const fs::path data = folder("rgbd_dataset_freiburg1_xyz");
  EXPECT_EQ(choose_camera("", data).origin, "fr1 (from the folder's name)");
  EXPECT_EQ(choose_camera("", data / "").camera.fx, 517.3);
  write_file_atomically(data / "camera.yaml", replaced(kCamera, "517.3", "400"));
  EXPECT_EQ(choose_camera("", data).camera.fx, 400);
  EXPECT_EQ(choose_camera("", data).origin, (data / "camera.yaml").string());
  EXPECT_EQ(choose_camera("fr3", data).camera.fx, 535.4);
  EXPECT_EQ(choose_camera((data / "camera.yaml").string(), folder("else")).camera.fx, 400);
  write_file_atomically(data / "camera.yaml", kRos);
  EXPECT_EQ(choose_camera("", data).origin,
            (data / "camera.yaml").string() + ", depth in millimetres (it says no depth_factor)");
}

TEST_F(ChooseCamera, KnowsFolderNamesAsWords) {
  EXPECT_EQ(choose_camera("", folder("fr2_desk")).camera.fx, 520.9);
  EXPECT_EQ(choose_camera("", folder("TUM-Freiburg3-walking")).camera.fx, 535.4);
  EXPECT_EQ(choose_camera("", folder("rgbd_bonn_balloon")).camera.fx, 542.822841);
  EXPECT_THROW(choose_camera("", folder("bonnet")), InputError);
  EXPECT_THROW(choose_camera("", folder("freiburg4_room")), InputError);
}

TEST_F(ChooseCamera, RefusalsNameTheFile) {
  EXPECT_NE(test::input_error_of([&] { choose_camera("/no/none.yaml", folder("a")); }).find("/no/none.yaml"),
            std::string::npos);
  EXPECT_EQ(test::input_error_of([&] { choose_camera("fr9", folder("a")); }),
            "fr9: neither a camera file nor a built-in camera (fr1, fr2, fr3, bonn)");
  EXPECT_NE(test::input_error_of([&] { choose_camera("bon", folder("a")); }).find("did you mean \"bonn\"?"),
            std::string::npos);
  EXPECT_NE(test::input_error_of([&] { choose_camera("", folder("a")); }).find("--camera"), std::string::npos);
}

TEST(CameraFile, MutatedFilesThrowNothingButInputErrors) {
  Random random(21);
  const std::string original = kCamera + "# comment\nk1: 0.5\nfps: 30\n";
  for (const std::string& text : {original, kRos, kOpenCv}) {
    int accepted = 0;
    for (int i = 0; i < 4000; ++i) {
      try {
        parse_camera(mutated(text, random), "camera.yaml").check();
        ++accepted;
      } catch (const InputError& e) {
        EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      }
    }
    EXPECT_GT(accepted, 0);
  }
}

}  // namespace
}  // namespace dkb
