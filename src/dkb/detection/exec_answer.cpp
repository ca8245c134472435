// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/exec_answer.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

constexpr int64_t kMaxBoxes = 10000;
constexpr std::string_view kBegin = "answer ", kEnd = "\nend\n";

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (!line.empty()) {
    const std::string_view word = line.substr(0, line.find(' '));
    line.remove_prefix(std::min(line.size(), word.size() + 1));
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

class AnswerLines {
 public:
  explicit AnswerLines(std::string_view text) : text_(text) {}

  std::string_view next() {
    line_ = text_.substr(0, text_.find('\n'));
    text_.remove_prefix(std::min(text_.size(), line_.size() + 1));
    return line_;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw InputError("it answered \"" + excerpt(line_) + "\" where " + expected + " was expected");
  }

 private:
  std::string_view text_, line_;
};

Detection parse_box(AnswerLines& lines) {
  const std::vector<std::string_view> words = words_of(lines.next());
  double numbers[5];
  bool sound = words.size() == 6;
  for (size_t i = 0; i < 5 && sound; ++i)
    sound = parse_number(words[i + 1], &numbers[i]) && std::abs(numbers[i]) < 1e6;  // false for NaN
  const auto printable = [](char c) { return c > ' ' && c < '\x7F'; };
  if (!sound || !std::all_of(words[0].begin(), words[0].end(), printable)) lines.fail("CLASS SCORE X Y W H");
  const auto [score, x, y, w, h] = numbers;
  if (!(score >= 0 && score <= 1 && w > 0 && h > 0)) lines.fail("a score of 0 ... 1 and a size above 0");
  return {std::string(words[0]),
          {static_cast<float>(x), static_cast<float>(y), static_cast<float>(w), static_cast<float>(h)},
          static_cast<float>(score)};
}

GreyImage parse_mask(const std::vector<std::string_view>& words, const AnswerLines& lines, int width, int height) {
  GreyImage mask(width, height);
  auto left = static_cast<int64_t>(mask.size());
  uint8_t* to = mask.data();
  for (size_t i = 1; i < words.size(); ++i) {
    int64_t run = 0;
    if (!parse_number(words[i], &run) || run < 0 || run > left) lines.fail("mask RUN RUN ..., within the image,");
    to = std::fill_n(to, run, i % 2 == 0 ? 255 : 0);
    left -= run;
  }
  if (left != 0) lines.fail("a mask of all " + std::to_string(mask.size()) + " pixels");
  return mask;
}

}  // namespace

size_t exec_answer_size(std::string_view text) {
  const size_t first = text.find('\n');
  if (first != std::string_view::npos && !text.starts_with(kBegin)) return first + 1;
  const size_t last = text.find(kEnd);
  return last == std::string_view::npos ? 0 : last + kEnd.size();
}

Detections parse_exec_answer(std::string_view text, int64_t number, int width, int height) {
  AnswerLines lines(text);
  std::vector<std::string_view> words = words_of(lines.next());
  int64_t of = 0, count = 0;
  if (words.size() != 3 || words[0] != "answer" || !parse_number(words[1], &of) || of != number ||
      !parse_number(words[2], &count) || count < 0 || count > kMaxBoxes)
    lines.fail("answer " + std::to_string(number) + " COUNT");
  Detections found;
  for (; count > 0; --count) found.boxes.push_back(parse_box(lines));
  words = words_of(lines.next());
  if (!words.empty() && words[0] == "mask") {
    found.mask = parse_mask(words, lines, width, height);
    words = words_of(lines.next());
  }
  if (words.size() != 1 || words[0] != "end") lines.fail("end");
  return found;
}

}  // namespace dkb
