// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>

namespace dkb {

void register_view(CLI::App& app, int& exit_code);

}  // namespace dkb
