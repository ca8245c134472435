// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/http_request.h"

#include <algorithm>
#include <charconv>
#include <cstring>

namespace dkb {
namespace {

bool is_alphanumeric(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
}

// RFC 9110's token.
bool is_token(std::string_view text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return is_alphanumeric(c) || (c != '\0' && std::strchr("!#$%&'*+-.^_`|~", c) != nullptr);
  });
}

bool is_path(std::string_view text) {
  return text.starts_with('/') && text.find("..") == std::string_view::npos &&
         std::all_of(text.begin(), text.end(),
                     [](char c) { return is_alphanumeric(c) || c == '/' || c == '.' || c == '-' || c == '_'; });
}

std::string_view trimmed(std::string_view text) {
  const auto space = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && space(text.front())) text.remove_prefix(1);
  while (!text.empty() && space(text.back())) text.remove_suffix(1);
  return text;
}

// What follows the `=` after `name`, or nothing at all when it is not there.
std::optional<std::string_view> value_in(std::string_view query, std::string_view name) {
  while (!query.empty()) {
    const size_t end = std::min(query.find('&'), query.size());
    const std::string_view item = query.substr(0, end);
    if (item == name) return std::string_view();
    if (item.starts_with(name) && item.substr(name.size()).starts_with('=')) return item.substr(name.size() + 1);
    query.remove_prefix(std::min(end + 1, query.size()));
  }
  return std::nullopt;
}

}  // namespace

std::string_view HttpRequest::header(std::string_view lower_case_name) const {
  for (const auto& [name, value] : headers)
    if (name == lower_case_name) return value;
  return {};
}

bool HttpRequest::asks_for(std::string_view name) const {
  const std::optional<std::string_view> value = value_in(query, name);
  return value && (value->empty() || *value == "1");
}

std::optional<uint64_t> HttpRequest::number(std::string_view name) const {
  const std::string_view value = value_in(query, name).value_or("");
  uint64_t number = 0;
  const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
  return error == std::errc() && end == value.data() + value.size() ? std::optional(number) : std::nullopt;
}

HttpRequestParser::State HttpRequestParser::refuse(int status) {
  status_ = status;
  bytes_.clear();
  return state_ = State::refused;
}

HttpRequestParser::State HttpRequestParser::feed(std::string_view bytes) {
  if (state_ != State::reading) return state_;
  // Never more than the next bound: a request that is too large is refused before it is kept.
  const size_t room = (has_head_ ? body_size_ : kMaxHead + 4 + kMaxBody) - bytes_.size();
  bytes_.append(bytes.substr(0, std::min(bytes.size(), room)));
  if (!has_head_) return read_head();
  return take_body();
}

HttpRequestParser::State HttpRequestParser::read_head() {
  const size_t end = bytes_.find("\r\n\r\n");
  if (end == std::string::npos) {
    // A client that does not speak HTTP is told at its first line.
    const size_t line = bytes_.find("\r\n");
    if (line == std::string::npos && bytes_.size() > kMaxHead / 2) return refuse(414);
    return bytes_.size() > kMaxHead ? refuse(431) : state_;
  }
  if (end > kMaxHead) return refuse(431);
  const std::string head = bytes_.substr(0, end);
  bytes_.erase(0, end + 4);
  has_head_ = true;
  size_t at = head.find("\r\n");
  if (!read_request_line(std::string_view(head).substr(0, at))) return state_;
  while (at != std::string::npos) {
    const size_t next = head.find("\r\n", at + 2);
    const size_t length = next == std::string::npos ? next : next - at - 2;
    if (!read_header(std::string_view(head).substr(at + 2, length))) return state_;
    at = next;
  }
  if (request_.header("host").empty()) return refuse(400);
  if (!request_.header("transfer-encoding").empty()) return refuse(411);
  const std::string_view length = request_.header("content-length");
  if (length.empty()) {
    if (request_.method == "POST") return refuse(411);
  } else {
    if (!std::all_of(length.begin(), length.end(), [](char c) { return c >= '0' && c <= '9'; })) return refuse(400);
    if (length.size() > 9) return refuse(413);
    for (const char c : length) body_size_ = body_size_ * 10 + static_cast<size_t>(c - '0');
    if (body_size_ > kMaxBody) return refuse(413);
    if (body_size_ > 0 && request_.method != "POST") return refuse(400);
  }
  return take_body();
}

bool HttpRequestParser::read_request_line(std::string_view line) {
  const size_t first = line.find(' '), last = line.rfind(' ');
  const auto bad = [&](int status) {
    refuse(status);
    return false;
  };
  if (first == std::string_view::npos || first == last) return bad(400);
  const std::string_view method = line.substr(0, first), target = line.substr(first + 1, last - first - 1),
                         version = line.substr(last + 1);
  if (!is_token(method)) return bad(400);
  if (!version.starts_with("HTTP/") || version.size() != 8) return bad(400);
  if (version != "HTTP/1.1" && version != "HTTP/1.0") return bad(505);
  if (method != "GET" && method != "POST") return bad(405);
  if (target.empty() || target.size() > 1024) return bad(target.empty() ? 400 : 414);
  if (!std::all_of(target.begin(), target.end(), [](char c) { return c > ' ' && c < '\x7f'; })) return bad(400);
  const size_t mark = std::min(target.find('?'), target.size());
  // No page of ours has a name that needs escapes, so that none is ever decoded.
  if (!is_path(target.substr(0, mark))) return bad(404);
  request_.method = method;
  request_.path = target.substr(0, mark);
  request_.query = target.substr(std::min(mark + 1, target.size()));
  return true;
}

bool HttpRequestParser::read_header(std::string_view line) {
  const auto bad = [&](int status) {
    refuse(status);
    return false;
  };
  if (request_.headers.size() >= kMaxHeaders) return bad(431);
  const size_t colon = line.find(':');
  if (colon == std::string_view::npos || !is_token(line.substr(0, colon))) return bad(400);
  const std::string_view value = trimmed(line.substr(colon + 1));
  const auto printable = [](char c) { return c == '\t' || (static_cast<unsigned char>(c) >= ' ' && c != '\x7f'); };
  if (!std::all_of(value.begin(), value.end(), printable)) return bad(400);
  std::string name(line.substr(0, colon));
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  for (const char* once : {"host", "content-length", "transfer-encoding", "origin", "sec-fetch-site", "x-dkb-token"}) {
    if (name != once) continue;
    // Sent empty, it would pass for absent.
    if (value.empty()) return bad(400);
    if (!request_.header(name).empty()) return bad(400);
  }
  request_.headers.emplace_back(std::move(name), value);
  return true;
}

HttpRequestParser::State HttpRequestParser::take_body() {
  if (bytes_.size() < body_size_) return state_;
  request_.body = bytes_.substr(0, body_size_);
  bytes_.clear();
  return state_ = State::complete;
}

}  // namespace dkb
