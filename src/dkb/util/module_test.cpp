// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/module.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

namespace dkb {
namespace {
namespace fs = std::filesystem;

TEST(Module, ThatIsNowhereIsSaidToBeNotInstalled) {
  std::string reason;
  EXPECT_EQ(module_symbol({"libdkb_no_such_module.so", "lib", {"", "/no/such/folder"}}, "anything", &reason), nullptr);
  EXPECT_EQ(reason, "libdkb_no_such_module.so is not installed beside it");
}

TEST(Module, ThatCannotBeLoadedIsNamedWithTheReason) {
  const fs::path folder = fs::temp_directory_path() / ("dkb-module-test-" + std::to_string(getpid()));
  fs::create_directory(folder);
  std::ofstream(folder / "libdkb_damaged.so") << "no shared library";
  std::string reason;
  EXPECT_EQ(module_symbol({"libdkb_damaged.so", "lib", {folder}}, "anything", &reason), nullptr);
  EXPECT_NE(reason.find((folder / "libdkb_damaged.so").string()), std::string::npos) << reason;
  EXPECT_EQ(reason.find('\n'), std::string::npos);
  fs::remove_all(folder);
}

TEST(Module, IsFoundInAFolderOfItsOwn) {
  std::string reason;
  const Module module{DKB_TEST_MODULE_FILE, "lib", {DKB_TEST_MODULE_FOLDER}};
  void* symbol = module_symbol(module, "dkb_test_answer", &reason);
  ASSERT_NE(symbol, nullptr) << reason;
  EXPECT_EQ(reinterpret_cast<int (*)()>(symbol)(), 42);
  EXPECT_EQ(module_symbol(module, "dkb_no_such_symbol", &reason), nullptr);
}

}  // namespace
}  // namespace dkb
