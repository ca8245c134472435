// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/page_server.h"

#include <fmt/format.h>

#include <exception>
#include <nlohmann/json.hpp>

#include "dkb/util/thread_priority.h"

namespace dkb {
namespace {

AccessRules rules_of(const std::string& host) {
  AccessRules rules;
  if (is_loopback_name(host)) return rules;
  rules.any_address = host == "0.0.0.0" || host == "::";
  std::string name = host;
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  rules.host_names = {name.find(':') == std::string::npos ? name : "[" + name + "]"};
  rules.token = random_token();
  return rules;
}

}  // namespace

PageServer::PageServer(const std::string& host, int port, HttpService& service)
    : host_(host), rules_(rules_of(host)), server_(host, port, rules_, service) {}

void PageServer::start() {
  thread_ = std::thread([this] {
    set_thread_priority(ThreadPriority::background);
    try {
      server_.run();
    } catch (const std::exception&) {
      // Out of memory, most likely: the page ends, the run goes on.
    }
  });
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
