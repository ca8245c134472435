// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "dkb/slam/options.h"

namespace dkb {

// The parts named by --disable, e.g. "dr,kf,ba,loop". Throws InputError for one that does not exist.
DisabledParts parse_disabled(const std::string& list);

// Adds `dkb-slam run`; the callback leaves the process's exit code in `exit_code`.
void register_run(CLI::App& app, int& exit_code);

}  // namespace dkb
