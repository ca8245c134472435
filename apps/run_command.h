// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dkb {

// Adds `dkb-slam run`; the callback leaves the process's exit code in `exit_code`.
void register_run(CLI::App& app, int& exit_code);
// Adds `dkb-slam live` likewise.
void register_live(CLI::App& app, int& exit_code);

}  // namespace dkb
