// SPDX-License-Identifier: Apache-2.0
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "eval_command.h"
#ifdef DKB_RUN
#include "run_command.h"
#endif
#ifdef DKB_SIMULATE
#include "simulate_command.h"
#endif

namespace {

constexpr int kFailed = 1, kBadInput = 2;

void print_error(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::fprintf(stderr, "error: %s\n", message.c_str());
}

// What is wrong with the command line, in one line, with the nearest name when one is misspelt.
std::string usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<CLI::App*> chosen = app.get_subcommands();
  const CLI::App& command = chosen.empty() ? app : *chosen.front();
  const std::vector<std::string> rest = app.remaining(true);
  const std::string help = "; see dkb-slam " + (chosen.empty() ? "" : command.get_name() + " ") + "--help";

  const auto is_option = [](const std::string& word) { return word.size() > 1 && word[0] == '-'; };
  const auto option = std::find_if(rest.begin(), rest.end(), is_option);
  if (option != rest.end()) {
    const std::string name = option->substr(0, option->find('='));
    std::vector<std::string> known;
    for (const CLI::Option* o : command.get_options())
      for (const std::string& long_name : o->get_lnames()) known.push_back("--" + long_name);
    return "unknown option " + name + dkb::did_you_mean(name, known) + help;
  }
  if (chosen.empty() && !rest.empty()) {
    std::vector<std::string> known;
    for (const CLI::App* c : app.get_subcommands({})) known.push_back(c->get_name());
    return "unknown command \"" + rest.front() + "\"" + dkb::did_you_mean(rest.front(), known) + help;
  }
  if (!rest.empty()) return "unexpected argument \"" + rest.front() + "\"" + help;
  return error.what() + help;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Real-time RGB-D SLAM that withstands people in the picture (DKB-SLAM)", "dkb-slam");
  app.set_version_flag("--version", "dkb-slam " DKB_VERSION);
  app.require_subcommand(1);
  int exit_code = 0;
  try {
#ifdef DKB_RUN
    dkb::register_run(app, exit_code);
#endif
    dkb::register_eval(app, exit_code);
#ifdef DKB_SIMULATE
    dkb::register_simulate(app, exit_code);
#endif
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);  // --help, --version
    print_error(usage_error(app, e));
    return kBadInput;
  } catch (const dkb::InputError& e) {
    print_error(e.what());
    return kBadInput;
  } catch (const std::exception& e) {
    print_error(e.what());
    return kFailed;
  }
  return exit_code;
}
