// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "dkb/detection/detection.h"

namespace dkb {

// What a detector in a process of its own says of an image of width x height [px]; docs/detectors.md has the format:
//   answer N COUNT             N = the image's number
//   CLASS SCORE X Y W H        COUNT times; [px], X and Y = top-left corner
//   mask RUN RUN ...           may be left out; [px] still, moving, still ..., row by row
//   end

// Length of the first answer in `text`; 0 while its end is not there. A line that begins no answer stands for one, so
// that it is refused at once.
size_t exec_answer_size(std::string_view text);

// Throws InputError naming the line. Boxes may reach beyond the image.
Detections parse_exec_answer(std::string_view text, int64_t number, int width, int height);

}  // namespace dkb
