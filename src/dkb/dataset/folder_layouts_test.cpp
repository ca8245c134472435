// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/folder_layouts.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <functional>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/layout_cameras.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"
#include "dkb_slam/source.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

const char* const kReplica =
    R"({"camera": {"w": 64, "h": 48, "fx": 60.0, "fy": 61, "cx": 31.5, "cy": 23.5, "scale": 6553.5}})";
const char* const kOpen3d =
    R"({"width": 64, "height": 48, "intrinsic_matrix": [52.5, 0, 0, 0, 52.6, 0, 31.5, 23.5, 1]})";
const char* const kMatrix = "117.0 0 63.5 0\n0 118.0 47.5 0\n0 0 1 0\n0 0 0 1\n";
const char* const kSensors =
    "%YAML:1.0\n# OpenLORIS\nd400_depth:\n   width: 1\nd400_color_optical_frame:\n   sensor_type: camera\n   fps: 30\n"
    "   width: 64\n   height: 48\n   intrinsics: !!opencv-matrix\n      rows: 1\n      data: [ 6.1e+01, 31.25,\n"
    "          6.2e+01, 23.75 ]\nbase:\n   width: 2\n";

class Layouts : public testing::Test {
 protected:
  Layouts() : folder(fs::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_layouts") / "scene") {
    fs::remove_all(folder.parent_path());
    fs::create_directories(folder);
  }
  ~Layouts() override { fs::remove_all(folder.parent_path()); }

  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((folder / name).parent_path());
    write_file_atomically(folder / name, text);
  }
  void colour(const std::string& name, int width = 64, int height = 48) const {
    const ColourImage image(width, height, Rgb{200, 100, 50});
    write(name, name.ends_with(".png") ? encode_png(image) : encode_jpeg(image));
  }
  void depth(const std::string& name, int width = 64, int height = 48, uint16_t value = 2000) const {
    write(name, encode_png(Image<uint16_t>(width, height, value)));
  }
  // Opened as users do; the depth [m] of the first frame's first pixel.
  float first_depth(int width, int height) const {
    SourceOptions options;
    options.threaded = false;
    const auto source = open_folder(folder, options);
    EXPECT_EQ(source->camera().width, width);
    SourceFrame frame = source->next();
    EXPECT_EQ(frame.state, SourceState::frame) << frame.note;
    if (frame.state != SourceState::frame) return -1;
    EXPECT_EQ(frame.frame.depth().height, height);
    return static_cast<const float*>(frame.frame.depth().data)[0];
  }
  std::string error() const {
    return test::input_error_of([&] { open_folder_layout(folder); });
  }
  const fs::path folder;
};

TEST_F(Layouts, SevenScenesIsNumberedInMillimetres) {
  for (const std::string n : {"000000", "000001", "000003"}) {
    colour("frame-" + n + ".color.png", 640, 480);
    depth("frame-" + n + ".depth.png", 640, 480);
    write("frame-" + n + ".pose.txt", "1 0 0 0\n");
  }
  const FolderLayout layout = open_folder_layout(folder);
  ASSERT_EQ(layout.dataset.pairs.size(), 3u);
  EXPECT_EQ(layout.dataset.pairs[2].stamp, "0.100000");
  EXPECT_EQ(layout.dataset.list, "the layout of 7-Scenes, stamps by number at 30/s");
  EXPECT_EQ(layout.camera->camera.fx, 585);
  EXPECT_EQ(first_depth(640, 480), 2.0F);
  depth("frame-000000.depth.png", 640, 480, 65535);
  EXPECT_EQ(first_depth(640, 480), 0.0F) << "65535 is no depth";
}

TEST_F(Layouts, ReplicaTellsItsCameraBesideOrAbove) {
  colour("results/frame000000.jpg"), colour("results/frame000001.jpg");
  depth("results/depth000000.png", 64, 48, 13107), depth("results/depth000001.png");
  EXPECT_FALSE(open_folder_layout(folder).camera);
  write("../cam_params.json", kReplica);
  EXPECT_EQ(first_depth(64, 48), 2.0F);
  write("cam_params.json", "{\"camera\": 1}");
  EXPECT_EQ(error(),
            (folder / "cam_params.json").string() + ": key \"w\" is missing; give --camera FILE or mend the file");
}

TEST_F(Layouts, ACameraThatIsAssumedAndStampsThatAreNoSecondsAreWarnedOf) {
  SourceOptions options;
  options.threaded = false;
  const auto open = [&] { return open_folder(folder, options); };
  colour("color/0.jpg", 640, 480), colour("color/1.jpg", 640, 480), colour("color/7.jpg", 640, 480);
  depth("depth/0.png", 640, 480), depth("depth/1.png", 640, 480);
  const auto guessed = open();
  const auto warnings = guessed->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("that of Redwood is assumed, 525 px"), std::string::npos) << warnings[0];
  EXPECT_NE(guessed->description().find("2 pairs by the layout of Redwood, stamps by number at 30/s, 1 images without"),
            std::string::npos)
      << guessed->description();
  write("camera.yaml", guessed->camera().to_yaml());
  EXPECT_TRUE(open()->take_warnings().empty());
  write("associations.txt", "0 color/0.jpg 0 depth/0.png\n33.3 color/1.jpg 33.3 depth/1.png\n");
  const auto milliseconds = open()->take_warnings();
  ASSERT_EQ(milliseconds.size(), 1u);
  EXPECT_NE(milliseconds[0].find("33 s apart"), std::string::npos) << milliseconds[0];
  // The camera's own rate is what the stamps are judged by later.
  write("associations.txt", "0 color/0.jpg 0 depth/0.png\n0.000036 color/1.jpg 0.000036 depth/1.png\n");
  for (const double fps : {0.0, 30.0}) {
    Camera camera = guessed->camera();
    camera.fps = fps;
    write("camera.yaml", camera.to_yaml());
    const auto close = open();
    EXPECT_EQ(close->camera().fps, fps);
    const auto doubts = close->take_warnings();
    ASSERT_EQ(doubts.size(), 1u);
    EXPECT_NE(doubts[0].find("are 3.6e-05 s apart in the median; they must be in seconds"), std::string::npos)
        << doubts[0];
  }
}

TEST_F(Layouts, AFolderOfResultsMakesNoReplica) {
  const auto list = [&] { return open_folder_layout(folder).dataset.list; };
  write("results/trajectory.txt", "");
  EXPECT_FALSE(has_folder_layout(folder));
  colour("color/0.jpg"), depth("depth/0.png");
  EXPECT_EQ(list(), "the layout of Redwood, stamps by number at 30/s");
  write("intrinsic/intrinsic_color.txt", "58 0 31.5 0\n0 58 23.5 0\n0 0 1 0\n0 0 0 1\n");
  EXPECT_EQ(list(), "the layout of ScanNet, stamps by number at 30/s");
  colour("results/frame000000.jpg"), depth("results/depth000000.png");
  EXPECT_EQ(list(), "the layout of Replica, stamps by number at 30/s");
  EXPECT_TRUE(has_folder_layout(folder));
}

TEST_F(Layouts, ScanNetsColourIsBroughtToTheSizeOfItsDepth) {
  colour("color/0.jpg", 130, 97), colour("color/10.jpg", 130, 97), colour("color/2.jpg", 130, 97);
  depth("depth/0.png"), depth("depth/2.png"), depth("depth/10.png");
  write("intrinsic/intrinsic_color.txt", kMatrix);
  const FolderLayout layout = open_folder_layout(folder);
  ASSERT_EQ(layout.dataset.pairs.size(), 3u);
  EXPECT_EQ(layout.dataset.pairs[1].stamp, "0.066667") << "10 comes after 2";
  const CameraModel& camera = layout.camera->camera;
  EXPECT_DOUBLE_EQ(camera.fx, 117.0 * 64 / 130);
  EXPECT_DOUBLE_EQ(camera.cx, 64.0 * 64 / 130 - 0.5);
  EXPECT_EQ(first_depth(64, 48), 2.0F);
  write("intrinsic/intrinsic_depth.txt", "90 0 31.5\n0 90 23.5\n0 0 1\n");
  EXPECT_NE(error().find("intrinsic_depth.txt: the depth camera sees another field"), std::string::npos);
}

TEST_F(Layouts, RedwoodIsKnownByItsFoldersAndTakesStampsFromNames) {
  colour("image/0000001-000000000000.jpg", 640, 480), colour("image/0000002-000000033369.jpg", 640, 480);
  depth("depth/0000001-000000000010.png", 640, 480), depth("depth/0000002-000000033379.png", 640, 480);
  const FolderLayout layout = open_folder_layout(folder);
  EXPECT_EQ(layout.dataset.list, "the layout of Redwood, stamps by name");
  EXPECT_EQ(layout.dataset.pairs[1].stamp, "0.033369");
  EXPECT_EQ(layout.dataset.pairs[1].depth_stamp, "0.033379");
  EXPECT_EQ(first_depth(640, 480), 2.0F);
}

TEST_F(Layouts, OneImageWithoutAStampLeavesAllToTheirNumbers) {
  colour("image/0000001-000000900000.jpg"), colour("image/0000002-000000933369.jpg"), colour("image/0000060.jpg");
  depth("depth/0000001-000000900010.png"), depth("depth/0000002-000000933379.png"), depth("depth/0000060.png");
  const FolderLayout layout = open_folder_layout(folder);
  EXPECT_EQ(layout.dataset.list, "the layout of Redwood, stamps by number at 30/s");
  EXPECT_EQ(layout.dataset.pairs[0].stamp, "0.033333");
  EXPECT_EQ(layout.dataset.pairs[1].depth_stamp, "0.066667");
  EXPECT_EQ(layout.dataset.pairs[2].stamp, "2.000000");
}

TEST_F(Layouts, Open3dTellsItsCamera) {
  colour("color/000000.jpg"), depth("depth/000000.png");
  write("camera_intrinsic.json", kOpen3d);
  EXPECT_EQ(open_folder_layout(folder).camera->camera.fy, 52.6);
  EXPECT_EQ(first_depth(64, 48), 2.0F);
  fs::remove(folder / "depth/000000.png");
  depth("depth/000007.png");
  EXPECT_EQ(error(),
            folder.string() + ": looks like Redwood, but no colour image has a depth image of the same number");
}

TEST_F(Layouts, OpenLorisIsPairedByItsLists) {
  colour("color/1.5.png"), depth("aligned_depth/1.51.png");
  write("color.txt", "# time path\n1.5 color/1.5.png\n");
  write("aligned_depth.txt", "1.51 aligned_depth/1.51.png\n");
  write("sensors.yaml", kSensors);
  const FolderLayout layout = open_folder_layout(folder);
  EXPECT_EQ(layout.dataset.pairs.at(0).depth_stamp, "1.51");
  EXPECT_EQ(layout.camera->camera.fx, 61);
  EXPECT_EQ(layout.camera->camera.cy, 23.75);
  EXPECT_EQ(first_depth(64, 48), 2.0F);
}

TEST_F(Layouts, IclNuimCountsImagesAndNamesDepthFirst) {
  write("associations.txt", "0 depth/0.png 0 rgb/0.png\n1 depth/1.png 1 rgb/1.png\n");
  const FolderLayout layout = open_folder_layout(folder);
  ASSERT_EQ(layout.dataset.pairs.size(), 2u);
  EXPECT_EQ(layout.dataset.pairs[1].colour_path, folder / "rgb/1.png");
  EXPECT_EQ(layout.dataset.pairs[1].stamp, "0.033333");
  EXPECT_EQ(layout.camera->camera.fy, 480);
  write("associations.txt", "1.5 depth/0.png 1.51 rgb/0.png\n2.5 depth/1.png 2.51 rgb/1.png\n");
  EXPECT_EQ(open_folder_layout(folder).dataset.pairs[1].stamp, "2.51") << "stamps stay stamps";
  EXPECT_FALSE(open_folder_layout(folder).camera);
}

TEST_F(Layouts, ACameraFileBesideTheDataGoesFirst) {
  colour("color/000000.jpg"), depth("depth/000000.png");
  write("camera.yaml", "fx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\nwidth: 64\nheight: 48\ndepth_factor: 4000\n");
  EXPECT_EQ(first_depth(64, 48), 0.5F);
}

TEST_F(Layouts, AnUnknownFolderIsToldWhatTumsLayoutLacks) {
  EXPECT_NE(error().find("rgb.txt: no such file; a dataset needs associations.txt, or rgb.txt and depth.txt"),
            std::string::npos);
}

TEST_F(Layouts, ImagesOfAnotherKindAreNamed) {
  const std::string kinds = "; colour is PNG or JPEG, depth PNG, TIFF, PFM or NPY";
  write("rgb/1.0.bmp", "BM"), write("rgb/2.0.bmp", "BM"), write("rgb/.hidden.x", ""), depth("depth/1.0.png");
  EXPECT_EQ(error(), (folder / "rgb").string() + ": holds no PNG or JPEG, but .bmp" + kinds);
  colour("rgb/1.0.png"), fs::remove(folder / "depth/1.0.png"), write("depth/1.0.exr", "");
  EXPECT_EQ(error(), (folder / "depth").string() + ": holds no image STAMP.png, but .exr" + kinds);
}

TEST_F(Layouts, FoldersThatAreTakenForASequenceAreToldApart) {
  write("trajectory.txt", ""), write("stats.json", "{}");
  EXPECT_EQ(error(), folder.string() + ": is a result folder, which `run` wrote; give the folder of the sequence");
  fs::remove(folder / "stats.json");
  write("b/rgb.txt", ""), write("c/notes.txt", "");
  EXPECT_EQ(error(), folder.string() + ": holds 1 sequence: name it, " + (folder / "b").string());
  write("a/associations.txt", "");
  EXPECT_EQ(error(), folder.string() + ": holds 2 sequences: name one, such as " + (folder / "a").string());
}

TEST_F(Layouts, ImagesNamedByTheirStampsNeedNoLists) {
  colour("rgb/1305031102.175304.png"), colour("rgb/1305031102.275326.jpg"), colour("rgb/999999999.5.png");
  depth("depth/1305031102.160407.png", 64, 48, 13107), depth("depth/1305031102.262886.png");
  write("rgb/notes.txt", ""), write("rgb/._1305031102.175304.png", "");
  EXPECT_TRUE(has_folder_layout(folder));
  const FolderLayout layout = open_folder_layout(folder);
  EXPECT_EQ(layout.dataset.list, "the names in rgb and depth");
  EXPECT_EQ(layout.dataset.unpaired, 1u);
  ASSERT_EQ(layout.dataset.pairs.size(), 2u);
  const DatasetPair& first = layout.dataset.pairs[0];
  EXPECT_EQ(first.stamp_ns, 1'305'031'102'175'304'000);
  EXPECT_EQ(first.depth_stamp, "1305031102.160407");
  EXPECT_EQ(first.colour_path, folder / "rgb/1305031102.175304.png");
  write("camera.yaml", "fx: 50\nfy: 50\ncx: 31.5\ncy: 23.5\nwidth: 64\nheight: 48\ndepth_factor: 13107\n");
  EXPECT_EQ(first_depth(64, 48), 1.0F);
}

TEST_F(Layouts, StampsOfWholeSecondsAmongOthersAreNoNumbers) {
  for (const char* stamp : {"0.966667", "1", "1.033333", "10.5"})
    colour(std::string("color/") + stamp + ".png"), depth(std::string("depth/") + stamp + ".png");
  const std::vector<DatasetPair> pairs = open_folder_layout(folder).dataset.pairs;
  ASSERT_EQ(pairs.size(), 4u);
  EXPECT_EQ(pairs[1].stamp, "1");
  EXPECT_EQ(pairs[3].stamp, "10.5") << "by time, not by name";
}

TEST_F(Layouts, AnImageWhoseNameIsNoStampIsNamed) {
  const std::string remedy =
      ": its name is no stamp in seconds, such as 1305031102.175304; rename the images, or list "
      "them with their stamps in rgb.txt and depth.txt (docs/sources.md, \"Your own images\")";
  colour("rgb/1305031102175304000.png"), depth("depth/1.5.png");
  EXPECT_FALSE(has_folder_layout(folder));
  EXPECT_EQ(error(), (folder / "rgb/1305031102175304000.png").string() + remedy) << "nanoseconds";
  fs::remove_all(folder / "rgb");
  colour("rgb/1.5.png"), depth("depth/frame_1.png");
  EXPECT_EQ(error(), (folder / "depth/frame_1.png").string() + remedy);
  fs::remove(folder / "depth/frame_1.png");
  colour("rgb/1.50.jpg");
  EXPECT_EQ(error(),
            (folder / "rgb/1.50.jpg").string() + ": its stamp is that of rgb/1.5.png as well; remove one of them");
  fs::remove(folder / "rgb/1.50.jpg");
  depth("depth/1.6.png"), fs::remove(folder / "depth/1.5.png");
  EXPECT_NE(error().find("rgb: no image has one of depth whose name is a stamp within 0.020 s"), std::string::npos)
      << error();
  fs::remove(folder / "depth/1.6.png");
  EXPECT_EQ(error(), (folder / "depth").string() + ": holds no image STAMP.png");
  write("depth.txt", "1.5 depth/1.5.png\n");
  EXPECT_NE(error().find("rgb.txt: no such file"), std::string::npos) << "a list alone: " << error();
}

TEST(LayoutCameras, MutatedTextsThrowNothingButInputErrors) {
  const std::vector<std::pair<std::string, std::function<void(const std::string&)>>> parsers = {
      {kReplica, [](const std::string& text) { parse_replica_camera(text, "cam_params.json"); }},
      {kOpen3d, [](const std::string& text) { parse_open3d_camera(text, "intrinsic.json"); }},
      {kMatrix, [](const std::string& text) { parse_intrinsic_matrix(text, "intrinsic_color.txt", 130, 97); }},
      {kSensors, [](const std::string& text) { parse_openloris_camera(text, "sensors.yaml"); }}};
  Random random(41);
  for (const auto& [text, parse] : parsers) {
    EXPECT_NO_THROW(parse(text));
    for (int i = 0; i < 3000; ++i) {
      try {
        parse(mutated(text, random));
      } catch (const InputError& e) {
        EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
      }
    }
  }
}

TEST(Resampled, EachPixelIsTheMeanOfWhatItCovers) {
  Picture picture;
  picture.grey = GreyImage(3, 1);
  picture.grey(0, 0) = 10, picture.grey(1, 0) = 40, picture.grey(2, 0) = 100;
  // Two pixels of 1.5: (10 + 40 / 2) / 1.5 = 20 and (40 / 2 + 100) / 1.5 = 80.
  const Picture half = resampled(picture, 2, 1);
  EXPECT_EQ(half.grey(0, 0), 20);
  EXPECT_EQ(half.grey(1, 0), 80);
}

}  // namespace
}  // namespace dkb
