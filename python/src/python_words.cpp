// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "bindings.h"

namespace dkb::python {
namespace {

struct Word {
  std::string_view option, keyword;
  bool takes_text;  // a str that stands behind it in messages: --detector motion
};
constexpr std::array kWords{Word{"--preset", "preset", false},
                            Word{"--disable", "disable", false},
                            Word{"--detector", "detector", true},
                            Word{"--model", "model", false},
                            Word{"--labels", "labels", false},
                            Word{"--classes", "classes", false},
                            Word{"--inference", "inference", true},
                            Word{"--boxes", "boxes", false},
                            Word{"--masks", "masks", false},
                            Word{"--camera", "camera", false},
                            Word{"--colour-topic", "colour_topic", false},
                            Word{"--depth-topic", "depth_topic", false},
                            Word{"--info-topic", "info_topic", false},
                            Word{"--odom-topic", "odom_topic", false},
                            Word{"--imu-topic", "imu_topic", false},
                            Word{"--prior-file", "prior_file", false},
                            Word{"--prior", "prior", true},
                            Word{"--skip-pairs", "skip_pairs", false},
                            Word{"--start", "start", false},
                            Word{"--end", "end", false},
                            Word{"--max-frames", "max_frames", false},
                            Word{"Options::dense_map", "dense=True", false}};

bool goes_on(char c) {
  return c == '-' || c == '_' || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

}  // namespace

std::string python_words(std::string_view text) {
  std::string made;
  bool quoted = false;  // what a user wrote stays as it is
  for (size_t at = 0; at < text.size();) {
    const auto* const word = std::find_if(kWords.begin(), kWords.end(), [&](const Word& w) {
      const size_t end = at + w.option.size();
      return text.substr(at).starts_with(w.option) && (end == text.size() || !goes_on(text[end]));
    });
    if (quoted || word == kWords.end()) {
      quoted ^= text[at] == '"';
      made += text[at++];
      continue;
    }
    at += word->option.size();
    made += word->keyword;
    if (!word->takes_text || at == text.size() || text[at] != ' ') continue;
    size_t end = text.find_first_of(" ;,)", at + 1);
    if (end == std::string_view::npos) end = text.size();
    if (text[end - 1] == ':') --end;
    made += "=\"" + std::string(text.substr(at + 1, end - at - 1)) + '"';
    at = end;
  }
  return made;
}

}  // namespace dkb::python
