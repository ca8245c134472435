// SPDX-License-Identifier: Apache-2.0
#include "view_command.h"

#include <fmt/format.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "dkb/slam/viewer_module.h"
#include "dkb/util/errors.h"
#include "dkb/viewer/replay.h"
#include "interrupt.h"
#include "number_check.h"
#include "terminal.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

struct ViewArguments {
  std::vector<std::string> sessions;
  int port = 8090;
  std::string host = "127.0.0.1";
  bool quiet = false;
};

fs::path session_file(const fs::path& given) {
  std::error_code error;
  if (!fs::exists(given, error)) throw InputError(given.string() + ": there is no such file or folder");
  if (!fs::is_directory(given, error)) return given;
  const fs::path file = given / "session.dkbs";
  if (!fs::exists(file, error))
    throw InputError(given.string() + ": holds no session.dkbs; `live` writes one, and so does `run --record`");
  return file;
}

int view(const ViewArguments& args) {
  ReplayOptions options;
  options.host = args.host;
  options.port = args.port;
  for (const std::string& session : args.sessions) options.files.push_back(session_file(session));
  const auto open = reinterpret_cast<OpenReplay>(viewer_symbol(kOpenReplaySymbol, "view"));
  std::string reason;
  const std::unique_ptr<Replay> replay(open(options, &reason));
  if (replay == nullptr) throw InputError(reason);

  std::mutex mutex;
  std::condition_variable interrupted;
  bool over = false;
  const Interrupt interrupt([&] {
    const std::lock_guard lock(mutex);
    over = true;
    interrupted.notify_all();
  });
  tell(stderr, "viewer: {}\n", replay->url());
  std::fflush(stderr);
  if (!args.quiet) tell(stdout, "the page is served until Ctrl-C\n");
  std::fflush(stdout);
  std::unique_lock lock(mutex);
  interrupted.wait(lock, [&] { return over; });
  return 0;
}

}  // namespace

void register_view(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<ViewArguments>();
  CLI::App* command = app.add_subcommand("view", "Replay a recorded session in the browser, or two side by side");
  command
      ->add_option("session", args->sessions, "Folder of a run, finished or not, or its session.dkbs; two to compare")
      ->required()
      ->expected(1, 2);
  command->add_option("--port", args->port, "Of the page (8090 by default, 0 = any free one)")
      ->transform(whole_number(0, 65535));
  command->add_option("--viewer-host", args->host,
                      "Address to serve at; another than 127.0.0.1 lets other machines in, with the printed token");
  command->add_flag("--quiet", args->quiet, "Print nothing but the page's address and errors");
  command->callback([args, &exit_code] { exit_code = view(*args); });
}

}  // namespace dkb
