// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "dkb/viewer/http_server.h"

namespace dkb {

// An HttpServer on a thread of its own, of low priority, with the rules that follow from where it is bound to.
class PageServer {
 public:
  // Binds; nobody is answered before start(). `host`: anything but a loopback name asks every visitor for a token.
  // Throws InputError.
  PageServer(const std::string& host, int port, HttpService& service);
  ~PageServer();
  void start();  // once

  std::string url() const;  // to open; holds the token where one is asked for
  void wake() { server_.wake(); }
  std::vector<std::string> take_warnings();  // why it ended by itself

 private:
  const std::string host_;
  const AccessRules rules_;
  HttpServer server_;
  std::mutex mutex_;  // guards the next one
  std::vector<std::string> warnings_;
  std::thread thread_;
};

// What a service answers, most of the time.
HttpAnswer json_answer(int status, std::string json);
HttpAnswer refusal_answer(int status, const std::string& why);

}  // namespace dkb
