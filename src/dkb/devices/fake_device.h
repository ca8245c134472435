// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "dkb_slam/source.h"

namespace dkb {

// What goes wrong with a fake device. Times are counted from the first frame's stamp.
struct FakeFaults {
  double drop = 0;        // share of the frames that never come, 0 ... 1
  double repeat = 0;      // share that comes twice (`double`)
  double swap = 0;        // share that comes after its successor
  double late = 0;        // share that comes 3 to 10 frames late
  double stall = 0;       // share after which nothing comes for half a second, then all at once
  double stall_at = -1;   // [s] one stall more; < 0 = none
  double stall_for = 0;   // [s]
  double unplug_at = -1;  // [s] when it is unplugged; < 0 = never
  double unplug_for = 1;  // [s] until it is plugged in again; the frames in between are gone
  uint64_t seed = 1;      // the same seed, the same faults
  double speed = 1;       // times the pace of the stamps, > 0
};

struct FakePlace {
  std::filesystem::path folder;
  FakeFaults faults;
};

// `fake:FOLDER?drop=0.1&double=0.1&swap=0.1&late=0.1&stall=SECONDS@AT&unplug=AT,FOR&seed=1&speed=1`, every parameter
// optional; stall=SHARE is the other form. Throws InputError naming what is wrong and what is known.
FakePlace parse_fake_place(const std::string& where);

// A recorded folder played as a live camera with these faults would give it.
std::unique_ptr<Source> open_fake_device(const std::string& where, const SourceOptions& options);

}  // namespace dkb
