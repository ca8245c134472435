// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/page_server.h"

#include <fmt/format.h>
#include <unistd.h>

#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "dkb/util/thread_priority.h"

namespace dkb {
namespace {

std::string machine_name() {
  char name[256] = {};
  return gethostname(name, sizeof name - 1) == 0 ? name : "";
}

}  // namespace

PageServer::PageServer(const std::string& host, int port, HttpService& service)
    : host_(host), rules_(access_rules_of(host, machine_name())), server_(host, port, rules_, service) {}

void PageServer::start() {
  thread_ = std::thread([this] {
    set_thread_priority(ThreadPriority::background);
    try {
      server_.run();
    } catch (const std::exception& e) {  // out of memory, most likely
      const std::lock_guard lock(mutex_);
      warnings_.push_back(fmt::format("the page has ended ({}); the run goes on without it", e.what()));
    }
  });
}

std::vector<std::string> PageServer::take_warnings() {
  const std::lock_guard lock(mutex_);
  return std::exchange(warnings_, {});
}

PageServer::~PageServer() {
  server_.stop();
  if (thread_.joinable()) thread_.join();
}

std::string PageServer::url() const {
  std::string host = host_;
  if (is_loopback_name(host))
    host = host == "::1" ? "[::1]" : host == "localhost" ? host : "127.0.0.1";
  else if (host.find(':') != std::string::npos)
    host = "[" + host + "]";
  return fmt::format("http://{}:{}/{}", host, server_.port(), rules_.token.empty() ? "" : "#token=" + rules_.token);
}

HttpAnswer json_answer(int status, std::string json) {
  HttpAnswer answer;
  answer.status = status;
  answer.type = "application/json";
  answer.own_body = std::move(json);
  return answer;
}

HttpAnswer refusal_answer(int status, const std::string& why) {
  return json_answer(status, nlohmann::json({{"error", why}}).dump());
}

}  // namespace dkb
