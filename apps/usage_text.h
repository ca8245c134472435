// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace dkb {

// Whether a command is named that does not exist, which asking for help hides.
bool asks_for_unknown_command(const CLI::App& app);

// What is wrong with the command line, in one line, with the nearest name when one is misspelt.
std::string usage_error(const CLI::App& app, const CLI::ParseError& error);

// The help, with every value of an option as it is to be written.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
  std::string make_option_usage(const CLI::Option* option) const override;
};

}  // namespace dkb
