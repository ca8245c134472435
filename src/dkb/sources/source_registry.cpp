// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include <algorithm>
#include <filesystem>

#include "dkb/devices/fake_device.h"
#include "dkb/devices/module_device.h"
#include "dkb/devices/oni_file.h"
#include "dkb/devices/v4l2_device.h"
#include "dkb/recordings/recorded_source.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

bool is_rosbag2(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return false;
  if (fs::exists(folder / "associations.txt", error) || fs::exists(folder / "rgb.txt", error)) return false;
  if (fs::exists(folder / "metadata.yaml", error)) return true;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    if (const std::string ending = it->path().extension(); ending == ".db3" || ending == ".mcap") return true;
  return false;
}

std::unique_ptr<Source> open_recording(const std::string& where, const SourceOptions& options) {
  return std::make_unique<RecordedSource>(where, options);
}

// What lies in a recording is told by its content; the kind by what is usual.
SourceKind recording_kind(const std::string& name, const std::string& form) {
  SourceKind kind;
  kind.name = name, kind.form = form;
  kind.fits = [ending = "." + name](const std::string& where) { return where.ends_with(ending); };
  kind.open = open_recording;
  return kind;
}

SourceKind rosbag2_kind() {
  SourceKind kind = recording_kind("db3", "FILE.db3, or the folder of a rosbag2");
  kind.fits = [](const std::string& where) { return where.ends_with(".db3") || is_rosbag2(where); };
  return kind;
}

SourceKind oni_kind() {
  SourceKind kind;
  kind.name = "oni", kind.form = "FILE.oni";
  kind.fits = [](const std::string& where) { return where.ends_with(".oni"); };
  kind.open = [](const std::string& where, const SourceOptions& options) { return open_oni_file(where, options); };
  return kind;
}

SourceKind live_kind(const std::string& name, const std::string& place) {
  SourceKind kind;
  kind.name = name, kind.form = name + place, kind.live = true;
  kind.fits = [name](const std::string& where) { return where == name || where.starts_with(name + ":"); };
  return kind;
}

SourceKind module_kind(const DeviceModule& module, const std::string& place) {
  SourceKind kind = live_kind(module.scheme, place);
  kind.open = [&module](const std::string& where, const SourceOptions& options) {
    return open_module_device(module, where, options);
  };
  kind.why_not = [&module] { return why_no_module(module); };
  kind.devices = [&module] { return devices_of(module); };
  return kind;
}

SourceKind v4l2_kind() {
  SourceKind kind = live_kind("v4l2", ":COLOUR,DEPTH");
  kind.open = [](const std::string& where, const SourceOptions& options) { return open_v4l2_device(where, options); };
  kind.devices = v4l2_devices;
  return kind;
}

SourceKind fake_kind() {
  SourceKind kind = live_kind("fake", ":FOLDER[?drop=0.1&...]");
  kind.open = [](const std::string& where, const SourceOptions& options) { return open_fake_device(where, options); };
  return kind;
}

SourceKind folder_kind() {
  SourceKind kind;
  kind.name = "folder", kind.form = "FOLDER";
  kind.fits = [](const std::string&) { return true; };
  kind.open = [](const std::string& where, const SourceOptions& options) { return open_folder(where, options); };
  return kind;
}

}  // namespace

std::vector<SourceKind> source_kinds() {
  return {fake_kind(),
          v4l2_kind(),
          module_kind(openni2_module(), "[:URI]"),
          module_kind(realsense_module(), "[:SERIAL]"),
          module_kind(orbbec_module(), "[:SERIAL]"),
          recording_kind("bag", "FILE.bag"),
          recording_kind("mcap", "FILE.mcap"),
          rosbag2_kind(),
          oni_kind(),
          folder_kind()};
}

bool is_live(const std::string& where) {
  const std::vector<SourceKind> kinds = source_kinds();
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const SourceKind& k) { return k.fits(where); });
  return kind != kinds.end() && kind->live;
}

std::unique_ptr<Source> open_source(const std::string& where, const SourceOptions& options) {
  for (const SourceKind& kind : source_kinds()) {
    if (!kind.fits(where)) continue;
    if (const std::string missing = kind.why_not(); !missing.empty()) throw InputError(where + ": " + missing);
    return kind.open(where, options);
  }
  throw InputError(where + ": no kind of source takes this; `dkb-slam sources` lists them");
}

}  // namespace dkb
