// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/exec_detector.h"

#include <utility>

#include "dkb/detection/detection.h"
#include "dkb/detection/exec_answer.h"
#include "dkb/util/errors.h"
#include "dkb/util/one_line.h"

namespace dkb {
namespace {

// Rows of red, green and blue bytes, also of a grey camera.
void append_pixels(std::string& to, const ImageView& view) {
  for (int y = 0; y < view.height; ++y) {
    const uint8_t* row = view.row(y);
    if (view.format == PixelFormat::rgb8) {
      to.append(reinterpret_cast<const char*>(row), view.row_bytes());
      continue;
    }
    for (int x = 0; x < view.width; ++x) to.append(3, static_cast<char>(row[x]));
  }
}

}  // namespace

ExecDetector::ExecDetector(std::string command, ExecPatience patience)
    : command_(std::move(command)), patience_(patience) {
  if (command_.find_first_not_of(" \t") == std::string::npos)
    throw InputError("--detector exec: no command; give --detector exec:COMMAND");
  start();
}

void ExecDetector::start() {
  process_ = std::make_unique<PipedCommand>(command_);
  images_ = 0;
}

void ExecDetector::reset() {
  if (process_ == nullptr) start();
}

Detections ExecDetector::ask(const DetectorInput& image) {
  const int64_t number = images_++;
  const ImageView& shown = image.colour.empty() ? image.grey : image.colour;
  const int width = shown.width, height = shown.height;
  request_ = "frame " + std::to_string(number) + " " + std::to_string(image.stamp_ns) + " " + std::to_string(width) +
             " " + std::to_string(height) + "\n";
  append_pixels(request_, shown);
  // A mask of single pixels, and more boxes than anybody finds.
  const size_t max_bytes = (1 << 20) + 2 * static_cast<size_t>(width) * static_cast<size_t>(height);
  const std::string answer =
      process_->ask(request_, exec_answer_size, max_bytes, number == 0 ? patience_.first : patience_.later);
  answered_ = true;
  return parse_exec_answer(answer, number, width, height);
}

Detections ExecDetector::detect(const DetectorInput& image) {
  if (process_ == nullptr) throw DetectorEnded("\"" + excerpt(command_) + "\" has ended");
  try {
    return ask(image);
  } catch (const NeverStarted& e) {
    process_.reset();
    const std::string what = "\"" + excerpt(command_) + "\" cannot be started (" + e.what() + ")";
    if (answered_) throw DetectorEnded(what);
    throw NeverStarted("--detector exec: " + what +
                       "; give a command that a shell can execute, with its path, or leave the detector out");
  } catch (const CommandEnded& e) {
    process_.reset();
    if (answered_) throw DetectorEnded("\"" + excerpt(command_) + "\": it " + e.what());
    throw NeverStarted("--detector exec: \"" + excerpt(command_) + "\" " + e.what() +
                       " before its first answer; what it wrote to its standard error says why: mend it, or leave the "
                       "detector out");
  } catch (const InputError& e) {
    process_.reset();
    throw DetectorEnded("\"" + excerpt(command_) + "\": " + e.what());
  }
}

}  // namespace dkb
