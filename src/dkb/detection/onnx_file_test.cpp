// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/onnx_file.h"

#include <gtest/gtest.h>

#include "dkb/detection/onnx_graph_test_util.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {
using namespace onnx_test;

std::string identity(const std::string& inputs) {
  return model(node("Identity", {"images"}, "output") + inputs);
}

TEST(OnnxFile, TellsTheInputsNameTypeAndSize) {
  const OnnxInput input = read_onnx_input(identity(value_info(11, "images", {1, 3, 256, 320})), "m");
  EXPECT_EQ(input.name, "images");
  EXPECT_EQ(input.element_type, 1);
  EXPECT_EQ(input.dims, (std::vector<int64_t>{1, 3, 256, 320}));
}

TEST(OnnxFile, OpenAndAbsurdSizesAreMinusOne) {
  const OnnxInput input = read_onnx_input(identity(value_info(11, "images", {1, 3, -1, 5'000'000'000})), "m");
  EXPECT_EQ(input.dims, (std::vector<int64_t>{1, 3, -1, -1}));
}

TEST(OnnxFile, InitialisersAreNoInputs) {
  const std::string graph = value_info(11, "weight", {3}) + value_info(11, "images", {1, 3, 64, 64}) +
                            tensor("weight", {3}, std::vector<float>{1, 2, 3});
  EXPECT_EQ(read_onnx_input(identity(graph), "m").name, "images");
}

TEST(OnnxFile, TheSizeThatBoxesReferToIsASecondInput) {
  const std::string image = value_info(11, "images", {1, 3, 64, 64});
  for (const std::string& graph : {image + value_info(11, "orig_target_sizes", {-1, 2}, 7),
                                   value_info(11, "orig_target_sizes", {-1, 2}, 7) + image}) {
    EXPECT_EQ(read_onnx_input(identity(graph), "m").name, "images");
    EXPECT_EQ(read_onnx_input(identity(graph), "m").size_name, "orig_target_sizes");
  }
  EXPECT_EQ(read_onnx_input(identity(image), "m").size_name, "");
  EXPECT_THROW(read_onnx_input(identity(image + value_info(11, "orig_target_sizes", {1, 2}, 1)), "m"), InputError);
}

TEST(OnnxFile, NoOrSeveralInputsAreRefused) {
  EXPECT_THROW(read_onnx_input(identity(""), "m"), InputError);
  EXPECT_THROW(read_onnx_input(identity(value_info(11, "a", {1}) + value_info(11, "b", {1})), "m"), InputError);
}

TEST(OnnxFile, WeightsInAnotherFileAreRefused) {
  const auto with_weights = [](int64_t location) {
    const std::string weights = number(1, 3) + number(2, 1) + message(8, "w") + number(14, location);
    return identity(value_info(11, "images", {1, 3, 64, 64}) + message(5, weights));
  };
  EXPECT_EQ(read_onnx_input(with_weights(0), "m").name, "images");
  EXPECT_EQ(
      test::input_error_of([&] { read_onnx_input(with_weights(1), "m"); }),
      "m: its weights lie in another file; export it as one file (external_data=False, or onnx.save of the loaded "
      "model)");
}

TEST(OnnxFile, EveryTruncationIsRefused) {
  const std::string whole =
      identity(value_info(11, "images", {1, 3, 64, 64}) + tensor("w", {2}, std::vector<float>{1, 2}));
  const size_t last_field = message(8, number(2, 12)).size();  // without the operator set it is whole again
  for (size_t size = 0; size < whole.size(); ++size)
    if (size != whole.size() - last_field) {
      EXPECT_THROW(read_onnx_input(std::string_view(whole).substr(0, size), "m"), InputError) << size;
    }
}

TEST(OnnxFile, AnyMutationIsReadOrRefused) {
  const std::string whole = put_graph(32, 32, {Put("output", {1, 2, 3})});
  Random random(5);
  size_t refused = 0;
  for (int i = 0; i < 20000; ++i) {
    std::string bytes = whole;
    for (uint32_t k = 1 + random.below(4); k > 0; --k) {
      const uint32_t at = random.below(static_cast<uint32_t>(bytes.size()));
      switch (random.below(3)) {
        case 0:
          bytes[at] = static_cast<char>(random.below(256));
          break;
        case 1:
          bytes.erase(at, 1 + random.below(8));
          break;
        default:
          bytes.insert(at, 1 + random.below(12), static_cast<char>(0xFF));
      }
      if (bytes.empty()) bytes = "x";
    }
    try {
      read_onnx_input(bytes, "m.onnx");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find("m.onnx: "), 0u);
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000u);
}

}  // namespace
}  // namespace dkb
