// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "dkb/detection/detection.h"
#include "dkb/detection/piped_command.h"

namespace dkb {

// How long an answer may take. So long that it tells nothing but that the command hangs.
struct ExecPatience {
  std::chrono::milliseconds first = std::chrono::seconds(60);  // models are loaded
  std::chrono::milliseconds later = std::chrono::seconds(10);
};

// The detector `exec`: a command that is given images on its standard input and answers with boxes and masks on its
// standard output (docs/detectors.md). The same answers in every run give the same run.
class ExecDetector final : public Detector {
 public:
  // Starts the command. Throws InputError when it is empty or no process can be started.
  explicit ExecDetector(std::string command, ExecPatience patience = {});

  // Throws InputError when the command ends, stalls, or answers in another format; it is ended then. NeverStarted when
  // there is no such command and never was one, and when it ends before it has ever answered.
  Detections detect(const DetectorInput& image) override;
  std::string kind() const override { return "exec"; }
  // Starts a command that was ended once more.
  void reset() override;

 private:
  void start();
  Detections ask(const DetectorInput& image);

  const std::string command_;
  const ExecPatience patience_;
  std::unique_ptr<PipedCommand> process_;  // none after a failure
  int64_t images_ = 0;                     // that the process was given
  bool answered_ = false;                  // this process or one before it
  std::string request_;
};

}  // namespace dkb
