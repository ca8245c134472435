// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/source.h"

namespace dkb {

// One kind of source: `run` and `live` find it by what the user typed, and `sources` lists it.
struct SourceKind {
  std::string name;  // also the scheme of `NAME:PLACE`, e.g. v4l2
  std::string form;  // what the user types: "FILE.bag", "v4l2:COLOUR,DEPTH"
  bool live = false;
  // Whether `where` names this kind: by its scheme, its ending, or what lies in the folder.
  std::function<bool(const std::string& where)> fits;
  // Throws InputError. `where` as typed.
  std::function<std::unique_ptr<Source>(const std::string& where, const SourceOptions& options)> open;
  // Empty when it can be used; else what is missing, in one line with the remedy.
  std::function<std::string()> why_not = [] { return std::string(); };
  // Devices that are plugged in, as the user would type them; for live kinds.
  std::function<std::vector<std::string>()> devices = [] { return std::vector<std::string>(); };
};

// In the order in which they are asked; folders are last.
std::vector<SourceKind> source_kinds();

// Whether `where` names a live device.
bool is_live(const std::string& where);

}  // namespace dkb
