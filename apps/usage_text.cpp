// SPDX-License-Identifier: Apache-2.0
#include "usage_text.h"

#include <algorithm>
#include <cstdint>
#include <sstream>
#include <string_view>
#include <vector>

#include "dkb/util/settings.h"

namespace dkb {
namespace {

// The number that `text` begins with, if so, and what comes after it.
bool take_number(std::string_view& text, int64_t* number) {
  const size_t end = std::min(text.find_first_not_of("0123456789"), text.size());
  if (!parse_number(text.substr(0, end), number)) return false;
  text.remove_prefix(end);
  return true;
}

std::string values(int64_t count) {
  return count == 1 ? "one value" : std::to_string(count) + " values";
}

// `VALUE not in {a,b}` of an option.
std::string not_one_of(const std::string& name, const std::string& value, const std::string& list) {
  std::vector<std::string> known;
  std::istringstream in(list);
  for (std::string item; std::getline(in, item, ',');) known.push_back(item);
  return name + ": there is no \"" + value + "\"" + did_you_mean(value, known) + "; give one of " + listed(known);
}

// What the parser of the command line says, in this program's words.
std::string in_plain_words(const std::string& text) {
  if (const std::string begin = "Could not convert: "; text.starts_with(begin))  // all of the others are text
    return text.substr(begin.size()) + " is not a number in range";
  const size_t colon = text.find(": ");
  if (colon == std::string::npos) return text;
  const std::string name = text.substr(0, colon), said = text.substr(colon + 2);
  if (const size_t list = said.find(" not in {"); list != std::string::npos && said.ends_with('}'))
    return not_one_of(name, said.substr(0, list), said.substr(list + 9, said.size() - list - 10));
  const std::string between = " required but received ";
  int64_t wanted = 0, given = 0;
  for (const std::string_view bound : {"At least ", "At Most "}) {
    if (!said.starts_with(bound)) continue;
    std::string_view rest = std::string_view(said).substr(bound.size());
    if (!take_number(rest, &wanted) || !rest.starts_with(between)) continue;
    rest.remove_prefix(between.size());
    if (!take_number(rest, &given)) continue;
    if (given > 1 && wanted == 1) return name + ": is given " + std::to_string(given) + " times; give it once";
    return name + ": " + values(given) + (given == 1 ? " is given; give " : " are given; give ") +
           std::to_string(wanted) + (bound == "At Most " ? " at most" : "");
  }
  std::string_view rest = said;
  if (take_number(rest, &wanted) && rest.starts_with(" required ") && rest.ends_with(" missing"))
    return name + ": " + (wanted == 1 ? "its value is" : std::to_string(wanted) + " values are") + " missing";
  return text;
}

}  // namespace

bool asks_for_unknown_command(const CLI::App& app) {
  const CLI::App* command = &app;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  const std::vector<std::string> rest = app.remaining(true);
  return !command->get_subcommands([](const CLI::App*) { return true; }).empty() && !rest.empty() &&
         !rest.front().starts_with('-');
}

std::string usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* command = &app;
  std::string path = "dkb-slam ";
  while (!command->get_subcommands().empty()) {
    command = command->get_subcommands().front();
    path += command->get_name() + " ";
  }
  const std::vector<const CLI::App*> below = command->get_subcommands([](const CLI::App*) { return true; });
  const std::vector<std::string> rest = app.remaining(true);
  const std::string help = "; see " + path + "--help";
  std::vector<std::string> commands;
  for (const CLI::App* c : below) commands.push_back(c->get_name());

  const auto is_option = [](const std::string& word) { return word.size() > 1 && word[0] == '-'; };
  const auto option = std::find_if(rest.begin(), rest.end(), is_option);
  if (option != rest.end()) {
    const std::string name = option->substr(0, option->find('='));
    std::vector<std::string> known;
    for (const CLI::Option* o : command->get_options())
      for (const std::string& long_name : o->get_lnames()) known.push_back("--" + long_name);
    return "unknown option " + name + did_you_mean(name, known) + help;
  }
  if (!below.empty() && !rest.empty()) {
    const std::string near = did_you_mean(rest.front(), commands);
    return "unknown command \"" + rest.front() + "\"" + (near.empty() ? "; commands: " + listed(commands) : near) +
           help;
  }
  if (!rest.empty()) return "unexpected argument \"" + rest.front() + "\"" + help;
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !below.empty()) {
    return "a command is missing: " + listed(commands) + help;
  }
  return in_plain_words(error.what()) + help;
}

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  std::string text = CLI::Formatter::make_option_opts(option);
  const std::string times = " x " + std::to_string(option->get_expected());
  const size_t at = text.find(times);
  if (option->get_expected_min() < 2 || at == std::string::npos) return text;
  const char between = option->get_delimiter() != 0 ? option->get_delimiter() : ' ';
  std::string more;
  for (int i = 1; i < option->get_expected(); ++i) more += between + get_label(option->get_type_name());
  return text.replace(at, times.size(), more);
}

std::string HelpFormatter::make_option_usage(const CLI::Option* option) const {
  const int most = option->get_expected_max();
  if (most < 2 || most >= CLI::detail::expected_max_vector_size) return CLI::Formatter::make_option_usage(option);
  std::string text;
  for (int i = 0; i < most; ++i) {
    const std::string name = make_option_name(option, true);
    const bool needed = option->get_required() && i < option->get_expected_min();
    text += (i == 0 ? "" : " ") + (needed ? name : "[" + name + "]");
  }
  return text;
}

}  // namespace dkb
