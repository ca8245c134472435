// SPDX-License-Identifier: Apache-2.0
// What a run warns of.
#include <fmt/format.h>

#include <algorithm>

#include "dkb/dataset/folder_source.h"
#include "dkb/dataset/image_codecs.h"
#include "dkb/util/files.h"
#include "dkb/util/stamps.h"
#include "run_session.h"

namespace dkb {

void RunSession::warn_of_viewer() {
  if (!viewer_) return;
  for (const std::string& line : viewer_->take_warnings()) warnings_.warn(line, line);
}

// No frame is lost in silence.
void RunSession::warn_of_dropped(size_t next_index) {
  const std::string why = "the machine is too slow for this pace";
  for (const int64_t dropped = source_->counts().dropped; dropped_ < dropped; ++dropped_)
    warnings_.warn("frame dropped, " + why, fmt::format("frame {}: one before it was dropped, {}", next_index, why));
}

// Files of another recording would do nothing in silence.
void RunSession::warn_of_unused() {
  if (boxes_ && !facts_.stamps.empty()) warn_of_stray_boxes();
  if (without_mask_ > 0)
    warnings_.warn("--masks",
                   without_mask_ == facts_.stamps.size()
                       ? args_.detection.masks.string() + ": no mask has the stamp of a frame; are they of this run?"
                       : fmt::format("{}: {} of {} frames have no mask", args_.detection.masks.string(), without_mask_,
                                     facts_.stamps.size()));
  if (!args_.prior_file.empty() && !had_prior_ && facts_.stamps.size() > 1)
    warnings_.warn("--prior-file",
                   args_.prior_file + ": tells of no frame's motion; are its times those of the images?");
}

// An image without boxes may show nobody; boxes without an image are of no use. Of a part of the recording, or where a
// run was interrupted, those before and after are of other images. So are as many as images that were left out.
void RunSession::warn_of_stray_boxes() {
  const std::string file = args_.detection.boxes.string();
  if (boxed_.empty())
    return warnings_.warn("--boxes", file + ": no box has the stamp of a frame; are they of this run?");
  const bool all = takes_all_images(args_) && !facts_.interrupted && !live_;
  size_t told = 0;
  for (const TimedBoxes& boxes : boxes_->boxes())
    told += all || (*boxed_.begin() <= boxes.timestamp && boxes.timestamp <= *boxed_.rbegin());
  const auto* folder = dynamic_cast<const FolderSource*>(&opened_);
  const size_t left_out = static_cast<size_t>(facts_.skipped + recording_->counts().unpaired + source_->counts().late) +
                          (folder != nullptr ? folder->unpaired() : 0);
  if (told - boxed_.size() > left_out)
    warnings_.warn("--boxes",
                   fmt::format("{}: {} of {} stamps belong to no image (within {:g} ms); write them as in rgb.txt",
                               file, told - boxed_.size(), told, 1000 * kSameStamp));
}

// Cameras of 10 or 12 bits are often stored in 16 as they are.
void RunSession::warn_of_darkness(const Frame& frame) {
  constexpr size_t kFirst = 5;
  constexpr int kDark = 16;  // of 255: what 4095 of 65535 becomes
  const auto* folder = dynamic_cast<const FolderSource*>(&opened_);
  if (folder == nullptr || facts_.stamps.size() > kFirst) return;
  const GreyImage& grey = frame.image()->grey;
  brightest_ = std::max<int>(brightest_, *std::max_element(grey.data(), grey.data() + grey.size()));
  if (facts_.stamps.size() < kFirst || brightest_ > kDark) return;
  const std::string name = folder->pairs().front().colour_path.string();
  if (read_image_header(read_file(name), name).bits == 16)
    warnings_.warn("dark", name +
                               ": this and the next images have 16 bits and use the lower 12 alone, so that they are "
                               "nearly black; multiply their pixels by 16");
}

void RunSession::warn_of_source() {
  for (const std::string& line : recording_->take_warnings()) warnings_.warn(line, line);
}

}  // namespace dkb
