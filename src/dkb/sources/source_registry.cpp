// SPDX-License-Identifier: Apache-2.0
#include "dkb/sources/source_registry.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "dkb/devices/fake_device.h"
#include "dkb/devices/module_device.h"
#include "dkb/devices/oni_file.h"
#include "dkb/devices/v4l2_device.h"
#include "dkb/recordings/message_stream.h"
#include "dkb/recordings/recorded_source.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

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

// Files of any name, too: a recorder that was killed leaves FILE.bag.active.
SourceKind bag_kind() {
  SourceKind kind = recording_kind("bag", "FILE.bag");
  kind.fits = [](const std::string& where) {
    std::error_code error;
    const auto of_others = {".mcap", ".db3", ".oni"};
    return where.ends_with(".bag") || (fs::is_regular_file(where, error) &&
                                       std::none_of(of_others.begin(), of_others.end(),
                                                    [&](const char* ending) { return where.ends_with(ending); }));
  };
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
  kind.open = [](const std::string& where, const SourceOptions& options) {
    std::error_code error;
    if (!fs::exists(where, error))
      throw InputError(where + ": no such folder, recording or camera; `dkb-slam sources` lists what there can be");
    return open_folder(where, options);
  };
  return kind;
}

}  // namespace

std::vector<SourceKind> source_kinds() {
  return {fake_kind(),
          v4l2_kind(),
          module_kind(openni2_module(), "[:URI]"),
          module_kind(realsense_module(), "[:SERIAL]"),
          module_kind(orbbec_module(), "[:SERIAL]"),
          bag_kind(),
          recording_kind("mcap", "FILE.mcap"),
          rosbag2_kind(),
          oni_kind(),
          folder_kind()};
}

namespace {

// What chooses among the topics of a bag would be lost on any other source without a word.
void refuse_options_of_bags(const std::string& where, const SourceOptions& options) {
  const std::pair<const char*, bool> given[] = {
      {"--colour-topic", !options.colour_topic.empty()}, {"--depth-topic", !options.depth_topic.empty()},
      {"--info-topic", !options.info_topic.empty()},     {"--odom-topic", !options.odom_topic.empty()},
      {"--imu-topic", !options.imu_topic.empty()},       {"--prior odom", options.prior == PriorKind::odometry},
      {"--prior imu", options.prior == PriorKind::imu}};
  for (const auto& [option, is_given] : given)
    if (is_given)
      throw InputError(std::string(option) + ": " + where + " is no bag, and only bags have topics; leave it out" +
                       (std::string(option).starts_with("--prior") ? ", or give --prior-file FILE" : ""));
}

}  // namespace

bool is_live(const std::string& where) {
  const std::vector<SourceKind> kinds = source_kinds();
  const auto kind = std::find_if(kinds.begin(), kinds.end(), [&](const SourceKind& k) { return k.fits(where); });
  return kind != kinds.end() && kind->live;
}

PriorKind prior_kind_named(const std::string& name, const std::string& option) {
  const std::vector<std::string> names = {"none", "odom", "imu", "auto"};
  constexpr PriorKind kinds[] = {PriorKind::none, PriorKind::odometry, PriorKind::imu, PriorKind::automatic};
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw InputError(option + ": there is no \"" + name + "\"" + did_you_mean(name, names) + "; none, odom, imu, auto");
  return kinds[found - names.begin()];
}

std::unique_ptr<Source> open_source(const std::string& where, const SourceOptions& options) {
  for (const SourceKind& kind : source_kinds()) {
    if (!kind.fits(where)) continue;
    if (const std::string missing = kind.why_not(); !missing.empty()) throw InputError(where + ": " + missing);
    std::error_code error;
    const bool is_bag = kind.name == "bag" || kind.name == "mcap" || kind.name == "db3";
    if (!is_bag && (kind.live || fs::exists(where, error))) refuse_options_of_bags(where, options);
    return kind.open(where, options);
  }
  throw InputError(where + ": no kind of source takes this; `dkb-slam sources` lists them");
}

}  // namespace dkb
