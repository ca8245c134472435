// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "dkb/dataset/rgbd_reader.h"
#include "dkb/image/skipped_motion.h"
#include "dkb_slam/source.h"

namespace dkb {

// What sources of recorded pairs have in common.
class ReaderSource : public Source {
 public:
  const Camera& camera() const override { return camera_; }
  SourceFrame next() override;
  void stop() override { reader_->stop(); }
  // Stage "decoding", one sample per pair. Complete at the end.
  StageTimes times() const { return reader_->times(); }
  // Of all colour images to come, where that is known beforehand; else empty.
  virtual std::vector<int64_t> stamps_ns() const { return {}; }

 protected:
  // To be called once, by the constructor. A camera that tells no frame rate, or one that the first stamps contradict
  // by a factor of more than 1.4, gets theirs, unless it is no camera's.
  void start(PairStream pairs, const Camera& camera, bool threaded);
  // Ends the thread that calls the stream of pairs, before what the stream needs is gone.
  void end() { reader_.reset(); }

 private:
  Camera camera_;
  std::unique_ptr<RgbdReader> reader_;
  SkippedMotion skipped_;  // of pairs that could not be read since the last frame
};

}  // namespace dkb
