// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_detector.h"

// jpeglib.h needs stdio first
#include <cstdio>

#include <jpeglib.h>

#include "dkb/detection/onnx_graph_test_util.h"
#include "dkb/detection/onnx_model_test_util.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_data.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;
using namespace onnx_test;

class OnnxDetectorTest : public ModelTest {
 protected:
  // The error's message, which must be one line that names the file.
  static std::string error_of(const OnnxOptions& options) {
    try {
      const OnnxDetector detector(options, 640, 480);
    } catch (const InputError& e) {
      const std::string text = e.what();
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
      EXPECT_EQ(text.find(options.model.string()), 0u) << text;
      return text;
    }
    ADD_FAILURE() << "no error";
    return "";
  }
};

// 96 x 64: 12 x 8 + 6 x 4 + 3 x 2 = 126 cells. One prediction of class 0 in the first row, whose score is the first
// channel's mean.
std::string one_box(int boxes_a_cell, int classes, float per_unit) {
  Put out("output", {1, boxes_a_cell * 126, 5 + classes});
  const float row[] = {32, 16, 20, 10, 1};
  std::copy_n(row, 5, out.bias.begin());
  out.slope[0][5] = per_unit;
  return put_graph(96, 64, {out});
}

std::string one_v8_box(int classes) {
  Put out("output", {1, 4 + classes, 126});
  const float box[] = {32, 16, 20, 10};
  for (int i = 0; i < 4; ++i) out({0, i, 0}) = box[i];
  out.slope[0][out.at({0, 4, 0})] = 1;
  return put_graph(96, 64, {out});
}

TEST_P(OnnxDetectorTest, YoloV5GraphsGetRgbUpToOneAndGiveBoxesInTheImage) {
  OnnxDetector detector(write(one_box(3, 80, 1.0f)), 192, 128);
  EXPECT_STREQ(detector.head().name, "YOLOv5");
  EXPECT_EQ(detector.input_width(), 96);
  const Detections found = detect_in(detector, 192, 128, {204, 0, 0});
  ASSERT_EQ(found.boxes.size(), 1u);
  EXPECT_EQ(found.boxes[0].class_name, "person");
  EXPECT_NEAR(found.boxes[0].score, 0.8f, 1e-4f);        // 204 / 255
  EXPECT_EQ(found.boxes[0].box, (Box{44, 22, 40, 20}));  // (32 - 10, 16 - 5, 20, 10) x 2
  EXPECT_TRUE(detect_in(detector, 192, 128, {0, 0, 255}).boxes.empty());
}

TEST_P(OnnxDetectorTest, YoloV8GraphsHaveNoObjectness) {
  OnnxDetector detector(write(one_v8_box(80)), 192, 128);
  EXPECT_STREQ(detector.head().name, "YOLOv8");
  const Detections found = detect_in(detector, 192, 128, {204, 0, 0});
  ASSERT_EQ(found.boxes.size(), 1u);
  EXPECT_NEAR(found.boxes[0].score, 0.8f, 1e-4f);
  EXPECT_EQ(found.boxes[0].box, (Box{44, 22, 40, 20}));
}

TEST_P(OnnxDetectorTest, YoloxGraphsGetBgrUpTo255) {
  OnnxDetector detector(write(one_box(1, 80, 1.0f / 255)), 96, 64);
  EXPECT_STREQ(detector.head().name, "YOLOX");
  EXPECT_TRUE(detect_in(detector, 96, 64, {204, 0, 0}).boxes.empty());
  const Detections found = detect_in(detector, 96, 64, {0, 0, 204});
  ASSERT_EQ(found.boxes.size(), 0u + 1);
  EXPECT_NEAR(found.boxes[0].score, 0.8f, 1e-4f);
}

TEST_P(OnnxDetectorTest, OpenYoloxGraphsTakeTheImagesShapeAt416) {
  std::vector<float> cell(85, 0.0f);
  cell[0] = cell[1] = 0.5f;  // box in the middle of the cell, exp(0) x 32 px
  cell[4] = 0.9f;
  cell[5] = 1.0f;
  OnnxDetector detector(write(yolox_graph(-1, -1, cell)), 640, 480);
  EXPECT_STREQ(detector.head().name, "YOLOX");
  EXPECT_EQ(detector.input_width(), 416);
  EXPECT_EQ(detector.input_height(), 320);  // 416 x 480 / 640 = 312, rounded up to a multiple of 32
  // 13 x 10 cells of 32 px; the last row covers input rows 288 ... 320, of which the image has 24, so it is clipped.
  const Detections found = detect_in(detector, 640, 480, {9, 9, 9});
  ASSERT_EQ(found.boxes.size(), 130u);
  EXPECT_NEAR(found.boxes[0].box.w, 32 * 640.0 / 416, 1e-3);
  EXPECT_NEAR(found.boxes[129].box.h, 24 * 480.0 / 312, 1e-2);
}

TEST_P(OnnxDetectorTest, OnlyMovableClassesAreGiven) {
  OnnxOptions options = write(one_box(3, 80, 1.0f));
  options.classes = "chair, dog";
  OnnxDetector detector(options, 96, 64);
  EXPECT_TRUE(detect_in(detector, 96, 64, {255, 0, 0}).boxes.empty());
  options.classes = "persn";
  EXPECT_NE(error_of(options).find("did you mean \"person\""), std::string::npos);
}

TEST_P(OnnxDetectorTest, LabelsMustMatchTheGraph) {
  OnnxOptions options = write(one_box(3, 2, 1.0f));
  EXPECT_NE(error_of(options).find("2 classes"), std::string::npos);
  options.labels = folder_ / "labels.txt";
  std::ofstream(options.labels) << "robot\r\nperson\r\n\r\n";
  options.classes = "robot";
  OnnxDetector detector(options, 96, 64);
  const Detections found = detect_in(detector, 96, 64, {255, 0, 0});
  ASSERT_EQ(found.boxes.size(), 1u);
  EXPECT_EQ(found.boxes[0].class_name, "robot");
  for (const char* text : {"robot\n", "robot\nperson\ncat\n", "", "robot\n\nperson\n"}) {
    std::ofstream(options.labels) << text;
    try {
      const OnnxDetector refused(options, 96, 64);
      ADD_FAILURE() << text;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("labels.txt"), std::string::npos) << e.what();
    }
  }
}

TEST_P(OnnxDetectorTest, MissingTruncatedAndForeignModelsAreNamed) {
  OnnxOptions options;
  options.model = folder_ / "none.onnx";
  error_of(options);
  error_of(write("not a model"));
  error_of(write(""));
  error_of(write("\x89PNG\r\n\x1a\n"));
  const std::string whole = one_box(3, 1, 1.0f);
  for (const size_t size : {size_t{1}, size_t{40}, whole.size() / 2, whole.size() - 1})
    error_of(write(whole.substr(0, size)));
}

TEST_P(OnnxDetectorTest, UnknownHeadsAreToldByTheirShapeAndTheKnownOnesListed) {
  const std::string text = error_of(write(put_graph(64, 64, {Put("output", {1, 300, 6})})));
  EXPECT_NE(text.find("1 x 300 x 6"), std::string::npos);
  for (const DetectorHead& head : detector_heads()) EXPECT_NE(text.find(head.name), std::string::npos) << text;
}

TEST_P(OnnxDetectorTest, LayersThatAreLackingAreNamed) {
  const std::string foreign = model(node("Frobnicate", {"images"}, "output") +
                                    value_info(11, "images", {1, 3, 64, 64}) + value_info(12, "output", {1, 84, 85}));
  const std::string text = error_of(write(foreign));
  EXPECT_NE(text.find("Frobnicate"), std::string::npos) << text;
  EXPECT_NE(text.find("export"), std::string::npos) << text;
}

TEST_P(OnnxDetectorTest, InputsThatAreNoFloatImageAreRefused) {
  const auto with_input = [&](const std::string& input) {
    return error_of(write(model(node("Identity", {"images"}, "output") + input)));
  };
  with_input(value_info(11, "images", {1, 3, 64, 64}, 10));
  with_input(value_info(11, "images", {1, 1, 64, 64}));
  with_input(value_info(11, "images", {4, 3, 64, 64}));
  with_input(value_info(11, "images", {1, 3, 70, 64}));
  with_input(value_info(11, "images", {1, 3, 64}));
}

INSTANTIATE_TEST_SUITE_P(By, OnnxDetectorTest, kBoth, inference_name);

// Real weights and images, where they are.

const fs::path kData = test_data();

Frame read_jpeg(const fs::path& path) {
  const std::string bytes = read_file(path);
  jpeg_decompress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_decompress(&jpeg);
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  jpeg.out_color_space = JCS_RGB;
  jpeg_start_decompress(&jpeg);
  ColourImage colour(static_cast<int>(jpeg.output_width), static_cast<int>(jpeg.output_height));
  while (jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = &colour.row(static_cast<int>(jpeg.output_scanline))->r;
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  return frame_of(std::move(colour));
}

struct RealModel {
  const char* file;
  const char* head;
  int width, height;
  int frames_by_ort, frames_by_opencv;  // per detection at 30 Hz
};

class RealModelTest : public testing::TestWithParam<std::tuple<RealModel, Inference>> {};

TEST_P(RealModelTest, FindsBothWalkingPeople) {
  const auto& [real, inference] = GetParam();
  const fs::path model = kData / "models" / real.file;
  const fs::path frames = kData / "rgbd_dataset_freiburg3_walking_halfsphere" / "rgb";
  if (!fs::exists(model) || !fs::exists(frames)) GTEST_SKIP() << "skipped: no " << model << " or " << frames;
  if (!available(inference)) GTEST_SKIP() << "skipped: no " << to_string(inference) << " here";
  std::vector<fs::path> files(fs::directory_iterator(frames), fs::directory_iterator{});
  std::sort(files.begin(), files.end());
  OnnxOptions options;
  options.model = model;
  options.inference = inference;
  OnnxDetector detector(options, 640, 480);
  EXPECT_EQ(detector.inference(), inference);
  EXPECT_STREQ(detector.head().name, real.head);
  EXPECT_EQ(detector.input_width(), real.width);
  EXPECT_EQ(detector.input_height(), real.height);
  EXPECT_EQ(detector.frames_per_detection(30),
            inference == Inference::onnxruntime ? real.frames_by_ort : real.frames_by_opencv);
  for (const size_t i : {size_t{2}, size_t{12}}) {
    const Frame image = read_jpeg(files.at(i));
    const Detections found = detector.detect(detector_input(image));
    const auto people = std::count_if(found.boxes.begin(), found.boxes.end(),
                                      [](const Detection& d) { return d.class_name == "person"; });
    EXPECT_EQ(people, 2) << files[i];
    EXPECT_EQ(detector.detect(detector_input(image)), found);  // the same bytes again
  }
}

INSTANTIATE_TEST_SUITE_P(Models, RealModelTest,
                         testing::Combine(testing::Values(RealModel{"yolov5n_640x480.onnx", "YOLOv5", 640, 480, 3, 6},
                                                          RealModel{"yolov5n_320x256.onnx", "YOLOv5", 320, 256, 1, 3},
                                                          RealModel{"yolox_nano.onnx", "YOLOX", 416, 416, 1, 4}),
                                          testing::Values(Inference::onnxruntime, Inference::opencv)));

}  // namespace
}  // namespace dkb
