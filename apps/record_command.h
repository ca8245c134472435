// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dkb {

// Adds `dkb-slam record` and `dkb-slam sources`; the callbacks leave the process's exit code in `exit_code`.
void register_record(CLI::App& app, int& exit_code);
void register_sources(CLI::App& app, int& exit_code);

}  // namespace dkb
