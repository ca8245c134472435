// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dkb {

// Adds `dkb-slam map` with info, export and merge; the callback leaves the process's exit code in `exit_code`.
void register_map(CLI::App& app, int& exit_code);

}  // namespace dkb
