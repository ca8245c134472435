// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dkb {

// `dkb-slam export`.
void register_export(CLI::App& app, int& exit_code);

}  // namespace dkb
