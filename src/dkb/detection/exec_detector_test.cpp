// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/exec_detector.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cerrno>
#include <string>

#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {

// Answers every image with one box: the first four bytes of its pixels, its class the stamp.
const std::string kFirstBytes =
    "while read -r word n stamp w h; do set -- $(head -c $((w * h * 3)) | od -An -v -tu1); "
    "echo answer $n 1; echo s$stamp 0.5 $1 $2 $3 $4; echo end; done";

class ExecDetectorTest : public testing::Test {
 protected:
  static DetectorInput input(const ColourImage& colour, const GreyImage& grey) {
    DetectorInput input;
    input.stamp_ns = 1'305'031'102'175'304'000;
    if (!colour.empty()) input.colour = {colour.data(), colour.width(), colour.height(), 0, PixelFormat::rgb8};
    input.grey = {grey.data(), grey.width(), grey.height(), 0, PixelFormat::grey8};
    return input;
  }
  static std::string error_of(ExecDetector& detector, const DetectorInput& shown) {
    return test::input_error_of([&] { detector.detect(shown); });
  }
  // What it says that it never started; empty when it fails otherwise.
  static std::string refusal_of(ExecDetector& detector, const DetectorInput& shown) {
    try {
      detector.detect(shown);
      ADD_FAILURE() << "it answered";
    } catch (const NeverStarted& e) {
      return e.what();
    } catch (const InputError&) {
    }
    return "";
  }
  static bool has_children() { return waitpid(-1, nullptr, WNOHANG) >= 0 || errno != ECHILD; }

  const ColourImage colour_{ColourImage(4, 2, Rgb{10, 20, 30})};
  const GreyImage grey_{GreyImage(4, 2, 77)};
  const DetectorInput image_ = input(colour_, grey_);
};

TEST_F(ExecDetectorTest, ShowsEachImageAndTakesItsAnswer) {
  {
    ExecDetector detector(kFirstBytes);
    EXPECT_EQ(detector.kind(), "exec");
    for (const uint8_t red : {10, 11, 12}) {
      ColourImage colour(4, 2, Rgb{red, 20, 30});
      colour(1, 0).r = 40;
      const Detections found = detector.detect(input(colour, grey_));
      ASSERT_EQ(found.boxes.size(), 1u);
      EXPECT_EQ(found.boxes[0],
                (Detection{"s1305031102175304000", {static_cast<float>(red), 20.0F, 30.0F, 40.0F}, 0.5F}));
    }
  }
  EXPECT_FALSE(has_children());
}

TEST_F(ExecDetectorTest, ShowsRowsThatArePaddedAndGreyImagesAsRgb) {
  ExecDetector detector(kFirstBytes);
  DetectorInput padded = image_;
  padded.colour.width = 1, padded.colour.stride = 4 * sizeof(Rgb);
  EXPECT_EQ(detector.detect(padded).boxes[0].box, (Box{10, 20, 30, 10}));
  EXPECT_EQ(detector.detect(input({}, grey_)).boxes[0].box, (Box{77, 77, 77, 77}));
}

TEST_F(ExecDetectorTest, ACommandThatEndsIsAnErrorUntilItIsStartedAnew) {
  ExecDetector detector("read -r line; head -c 24 >/dev/null; printf 'answer 0 0\\nend\\n'; exit 3");
  EXPECT_EQ(detector.detect(image_), Detections());
  EXPECT_NE(error_of(detector, image_).find(": it ended"), std::string::npos);
  EXPECT_FALSE(has_children());
  EXPECT_NE(error_of(detector, image_).find("has ended"), std::string::npos);
  detector.reset();
  EXPECT_EQ(detector.detect(image_), Detections());
}

TEST_F(ExecDetectorTest, NobodyWhoReadsIsAnErrorAndNoSignal) {
  const GreyImage large(1000, 1000);
  for (const char* command : {"exit 0", "exec <&-; sleep 0.05"}) {
    ExecDetector detector(command);
    EXPECT_NE(refusal_of(detector, input({}, large)).find("before its first answer"), std::string::npos) << command;
  }
  EXPECT_FALSE(has_children());
}

TEST_F(ExecDetectorTest, ACommandThatNoShellCanStartNeverWasADetector) {
  const GreyImage large(1000, 1000);
  const std::pair<std::string, std::string> commands[] = {
      {"no-such-command-anywhere 2>/dev/null", "exit status 127: the shell finds no such command"},
      {"/ 2>/dev/null", "exit status 126: the shell may not execute it"}};
  for (const auto& [command, why] : commands) {
    ExecDetector detector(command);
    EXPECT_EQ(refusal_of(detector, input({}, large)),
              "--detector exec: \"" + command + "\" cannot be started (" + why +
                  "); give a command that a shell can execute, with its path, or leave the detector out");
  }
  EXPECT_FALSE(has_children());
}

// Such as a script whose module is missing.
TEST_F(ExecDetectorTest, ACommandThatEndsBeforeItsFirstAnswerNeverWasADetector) {
  ExecDetector script("read -r line; exit 1");
  EXPECT_EQ(refusal_of(script, image_),
            "--detector exec: \"read -r line; exit 1\" ended (exit status 1) before its first answer; what it wrote to "
            "its standard error says why: mend it, or leave the detector out");
  EXPECT_FALSE(has_children());
}

TEST_F(ExecDetectorTest, WhatSpokeOnceIsNoCommandThatNeverStarted) {
  ExecDetector loads("echo loading the model; exit 127");
  EXPECT_EQ(refusal_of(loads, image_), "");
  const test::TempFolder temp;
  const std::string mark = (temp / "mark").string();
  ExecDetector detector("test -e " + mark + " && exit 127; touch " + mark +
                        "; read -r line; head -c 24 >/dev/null; printf 'answer 0 0\\nend\\n'; exit 127");
  EXPECT_EQ(detector.detect(image_), Detections());
  EXPECT_EQ(refusal_of(detector, image_), "");
  detector.reset();
  EXPECT_EQ(refusal_of(detector, image_), "") << "it is gone, but it was there";
}

TEST_F(ExecDetectorTest, AnAnswerThatDoesNotComeIsWaitedForSoLongAlone) {
  using std::chrono::milliseconds;
  ExecDetector at_once("exec sleep 1000", {milliseconds(30), milliseconds(10)});
  EXPECT_NE(error_of(at_once, image_).find("it gave no answer within 0.03 s"), std::string::npos);
  ExecDetector later("read -r line; head -c 24 >/dev/null; printf 'answer 0 0\\nend\\nansw'; sleep 1000 | cat",
                     {std::chrono::seconds(60), milliseconds(10)});
  EXPECT_EQ(later.detect(image_), Detections());
  EXPECT_NE(error_of(later, image_).find("it gave no answer within 0.01 s"), std::string::npos);
  EXPECT_FALSE(has_children());
}

TEST_F(ExecDetectorTest, GarbageIsAnErrorHoweverMuchItIs) {
  for (const char* command : {"echo loading; echo end; cat >/dev/null", "yes", "cat", "yes end", "cat /dev/zero"}) {
    ExecDetector detector(command);
    const std::string error = error_of(detector, image_);
    EXPECT_TRUE(error.find("was expected") != std::string::npos || error.find("more than") != std::string::npos)
        << command << ": " << error;
    EXPECT_FALSE(has_children()) << command;
  }
}

TEST_F(ExecDetectorTest, ACommandThatIsEmptyIsRefused) {
  EXPECT_NE(test::input_error_of([] { ExecDetector(" "); }).find("give --detector exec:COMMAND"), std::string::npos);
}

}  // namespace
}  // namespace dkb
