// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace dkb {

// One HTTP/1.1 request, of the little that a page needs: GET or POST, a target that is a path with an optional query,
// headers, and a body of a stated length. Everything else is refused, with the status to answer with.
struct HttpRequest {
  std::string method;  // GET, POST
  std::string path;    // begins with '/'; letters, digits, '/', '.', '-' and '_'; nothing in it is decoded
  std::string query;   // what follows the '?'
  std::vector<std::pair<std::string, std::string>> headers;  // names in lower case, values without space around
  std::string body;

  // The header's value; empty when there is none. Of those that the server looks at none may come twice.
  std::string_view header(std::string_view lower_case_name) const;
  // Whether the query holds `name`, alone or as `name=1`.
  bool asks_for(std::string_view name) const;
  // The whole number N of `name=N` in the query; nothing when it is missing or something else.
  std::optional<uint64_t> number(std::string_view name) const;
};

// Takes a request's bytes as they come, in any pieces. Bounded: it keeps at most kMaxHead + kMaxBody bytes.
class HttpRequestParser {
 public:
  static constexpr size_t kMaxHead = 8192, kMaxBody = 4096, kMaxHeaders = 64;
  enum class State { reading, complete, refused };

  // Takes `bytes`. What follows a complete request is ignored: one request a connection.
  State feed(std::string_view bytes);
  State state() const { return state_; }
  const HttpRequest& request() const { return request_; }  // complete
  int status() const { return status_; }                   // refused: 400, 404, 405, 411, 413, 414, 431 or 505

 private:
  State refuse(int status);
  State read_head();
  bool read_request_line(std::string_view line);
  bool read_header(std::string_view line);
  State take_body();

  State state_ = State::reading;
  int status_ = 0;
  std::string bytes_;
  bool has_head_ = false;
  size_t body_size_ = 0;
  HttpRequest request_;
};

}  // namespace dkb
