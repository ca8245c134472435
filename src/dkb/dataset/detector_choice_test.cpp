// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/detector_choice.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

using Kinds = std::vector<std::string>;

TEST(DetectorKinds, BlanksAroundThemDoNotMatterButForACommand) {
  EXPECT_EQ(detector_kinds("motion+file", false), (Kinds{"motion", "file"}));
  EXPECT_EQ(detector_kinds(" motion + file ", false), (Kinds{"motion", "file"}));
  EXPECT_EQ(detector_kinds("motion + exec:a + b", false), (Kinds{"motion", "exec:a + b"}));
  EXPECT_EQ(detector_kinds("motion+exec:a +exec:b", false), (Kinds{"motion", "exec:a +exec:b"}));
  EXPECT_EQ(detector_kinds("none", false), Kinds());
}

TEST(DetectorChoice, MasksNeedNoFileOfBoxes) {
  DetectorChoice choice;
  choice.kinds = "file", choice.masks = "masks";
  EXPECT_EQ(test::input_error_of([&] { make_detectors(choice, Camera()); }),
            "--detector file: no boxes; name their file with --boxes; --masks goes with any other detector, --detector "
            "none too");
}

}  // namespace
}  // namespace dkb
