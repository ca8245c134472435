// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/ort_library.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "dkb/detection/onnx_graph_test_util.h"
#include "dkb/detection/onnx_network.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {
namespace fs = std::filesystem;

// $DKB_ONNXRUNTIME as given while it lives.
class Named {
 public:
  explicit Named(const std::string& value) {
    if (const char* before = std::getenv("DKB_ONNXRUNTIME")) before_ = before;
    setenv("DKB_ONNXRUNTIME", value.c_str(), 1);
  }
  ~Named() {
    if (before_)
      setenv("DKB_ONNXRUNTIME", before_->c_str(), 1);
    else
      unsetenv("DKB_ONNXRUNTIME");
  }

 private:
  std::optional<std::string> before_;
};

// Why the library that is named is refused: one line that names it.
std::string refusal(const std::string& named) {
  const Named name(named);
  std::string reason;
  EXPECT_TRUE(onnxruntime_is_named());
  EXPECT_FALSE(load_onnxruntime(&reason));
  EXPECT_NE(reason.find(named), std::string::npos) << reason;
  EXPECT_EQ(reason.find('\n'), std::string::npos) << reason;
  return reason;
}

TEST(OrtLibrary, ThatIsNotThereIsNamed) {
  refusal("/no/such/libonnxruntime.so");
}

TEST(OrtLibrary, OfAFolderIsItsSharedLibrary) {
  const fs::path folder = fs::temp_directory_path() / ("dkb-onnxruntime-test-" + std::to_string(getpid()));
  fs::create_directory(folder);
  std::ofstream(folder / "libonnxruntime.so.1") << "no shared library";
  EXPECT_NE(refusal(folder.string()).find((folder / "libonnxruntime.so.1").string()), std::string::npos);
  fs::remove_all(folder);
}

TEST(OrtLibrary, OfAnOldVersionIsRefusedWithBothVersions) {
  const std::string reason = refusal(DKB_OLD_ONNXRUNTIME);
  EXPECT_NE(reason.find("1.9.1"), std::string::npos) << reason;
  EXPECT_NE(reason.find("1.14"), std::string::npos) << reason;
}

TEST(OrtLibrary, ThatIsNamedIsNeverPassedOver) {
  const Named name(DKB_OLD_ONNXRUNTIME);
  const std::string graph = onnx_test::put_graph(32, 32, {onnx_test::Put("output", {1, 1, 1})});
  for (const Inference inference : {Inference::automatic, Inference::onnxruntime}) {
    try {
      open_network(inference, graph, {"images"}, "m.onnx");
      ADD_FAILURE() << to_string(inference);
    } catch (const InputError& e) {
      const std::string text = e.what();
      EXPECT_EQ(text.find("m.onnx: "), 0u) << text;
      EXPECT_NE(text.find("make onnxruntime"), std::string::npos) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    }
  }
  EXPECT_FALSE(available(Inference::onnxruntime));
}

}  // namespace
}  // namespace dkb
