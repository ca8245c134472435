// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/exec_answer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

TEST(ExecAnswer, BoxesAndAMaskAreRead) {
  const Detections found = parse_exec_answer(
      "answer 7 2\nperson 0.75 1 2 3.5 4\ndining-table 1 -5 0 400 9\nmask 2 3 10 1 8\nend\n", 7, 6, 4);
  ASSERT_EQ(found.boxes.size(), 2u);
  EXPECT_EQ(found.boxes[0], (Detection{"person", {1, 2, 3.5F, 4}, 0.75F}));
  EXPECT_EQ(found.boxes[1], (Detection{"dining-table", {-5, 0, 400, 9}, 1}));
  ASSERT_EQ(found.mask.size(), 24u);
  for (int i = 0; i < 24; ++i) EXPECT_EQ(found.mask.data()[i], (i >= 2 && i < 5) || i == 15 ? 255 : 0) << i;
}

TEST(ExecAnswer, NothingFoundIsAnAnswer) {
  EXPECT_EQ(parse_exec_answer("answer 0 0\nend\n", 0, 6, 4), Detections());
  EXPECT_EQ(parse_exec_answer("answer 0 0\nmask 24\nend\n", 0, 6, 4).mask, GreyImage(6, 4));
}

TEST(ExecAnswer, EndsWithItsLastLine) {
  const std::string answer = "answer 0 1\nend 1 1 1 1 1\nend\n";
  for (size_t n = 0; n < answer.size(); ++n) EXPECT_EQ(exec_answer_size(answer.substr(0, n)), 0u) << n;
  EXPECT_EQ(exec_answer_size(answer + "answer 1 0\nend\n"), answer.size());
  EXPECT_EQ(exec_answer_size("loading\nanswer 0 0\nend\n"), 8u) << "what is none is not waited for";
}

TEST(ExecAnswer, AWrongLineIsQuotedBesideWhatWasExpected) {
  const auto error = [](const std::string& text) {
    return test::input_error_of([&] { parse_exec_answer(text, 3, 6, 4); });
  };
  EXPECT_EQ(error("loading\x1B[1m model\nend\n"),
            "it answered \"loading [1m model\" where answer 3 COUNT was expected");
  for (const char* first : {"answer 2 0", "answer 3", "answer 3 -1", "answer 3 1e9", "answer 3 10001", "answer 3 0 0"})
    EXPECT_EQ(error(std::string(first) + "\nend\n"),
              "it answered \"" + std::string(first) + "\" where answer 3 COUNT was expected");
  for (const char* box : {"person 1 2 3 4", "person 0.5 nan 2 3 4", "person 0.5 1 2 3 x", "p\tq 0.5 1 2 3 4", "end"})
    EXPECT_NE(error("answer 3 1\n" + std::string(box) + "\nend\n").find("CLASS SCORE X Y W H"), std::string::npos)
        << box;
  for (const char* box : {"person 1.5 1 2 3 4", "person -0.1 1 2 3 4", "person 0.5 1 2 0 4", "person 0.5 1 2 3 -4"})
    EXPECT_NE(error("answer 3 1\n" + std::string(box) + "\nend\n").find("a score of 0 ... 1 and a size above 0"),
              std::string::npos)
        << box;
  for (const char* mask : {"mask", "mask 23", "mask 12 12 1", "mask -1 25", "mask 24.0", "mask 9223372036854775807 25"})
    EXPECT_NE(error("answer 3 0\n" + std::string(mask) + "\nend\n").find("mask"), std::string::npos) << mask;
  EXPECT_EQ(error("answer 3 0\nperson 0.5 1 2 3 4\nend\n"),
            "it answered \"person 0.5 1 2 3 4\" where end was expected");
}

TEST(ExecAnswer, MutatedAnswersThrowNothingButInputErrors) {
  const std::string original = "answer 7 2\nperson 0.75 1 2 3.5 4\nchair 1 -5 0 400 9\nmask 2 3 10 1 8\nend\n";
  Random random(77);
  int sound = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text = original;
    for (uint32_t k = 1 + random.below(3); k > 0; --k) {
      const size_t at = random.below(static_cast<uint32_t>(text.size()));
      const char digit = static_cast<char>('0' + random.below(10)), any = static_cast<char>(random.below(256));
      if (random.below(4) == 0)
        text.insert(at, text.substr(random.below(static_cast<uint32_t>(text.size())), random.below(20)));
      else
        text[at] = random.below(2) == 0 ? digit : any;
    }
    try {
      const Detections found = parse_exec_answer(text.substr(0, exec_answer_size(text)), 7, 6, 4);
      ++sound;
      EXPECT_TRUE(found.mask.empty() || found.mask.size() == 24u);
      for (const Detection& d : found.boxes) {
        EXPECT_TRUE(std::isfinite(d.box.x) && std::isfinite(d.box.y) && d.box.w > 0 && d.box.h > 0);
        EXPECT_TRUE(d.score >= 0 && d.score <= 1);
      }
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
  EXPECT_GT(sound, 100);
}

}  // namespace
}  // namespace dkb
