// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dkb_slam/source.h"

namespace dkb {

// A kind of camera whose maker's library is in a module.
struct DeviceModule {
  std::string scheme;   // openni2, realsense, orbbec
  std::string file;     // libdkb_openni2.so
  std::string library;  // what the module is linked with, for people
  std::string remedy;   // how a build comes to have it
};

const DeviceModule& openni2_module();
const DeviceModule& realsense_module();
const DeviceModule& orbbec_module();

// Empty when the module can be loaded, else why not and the remedy, in one line.
std::string why_no_module(const DeviceModule& module);

// The devices that are plugged in, as a user would name them. Throws InputError.
std::vector<std::string> devices_of(const DeviceModule& module);

// The device at `scheme:PLACE`, or `scheme` for the first one; live, frames as they come. Throws InputError.
std::unique_ptr<Source> open_module_device(const DeviceModule& module, const std::string& where,
                                           const SourceOptions& options);

}  // namespace dkb
