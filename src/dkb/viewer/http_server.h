// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <list>
#include <memory>
#include <string>
#include <string_view>

#include "dkb/viewer/access_rules.h"
#include "dkb/viewer/http_request.h"

namespace dkb {

// A response that goes on until one of the two has enough.
class HttpStream {
 public:
  virtual ~HttpStream() = default;
  // What the client has not been told yet: called only when all before has been sent, so that a slow client gets less
  // often more, and nothing is queued for it. Empty when there is nothing new.
  virtual std::string next() = 0;
};

struct HttpAnswer {
  int status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string_view body;               // outlives the server
  std::string own_body;                // instead of `body`
  std::unique_ptr<HttpStream> stream;  // instead of both
};

// What a server serves. Called on the server's thread.
class HttpService {
 public:
  virtual ~HttpService() = default;
  virtual HttpAnswer answer(const HttpRequest& request) = 0;
  // Before the streams are asked, some 30 times a second at most; `streams` = how many there are.
  virtual void tick(size_t streams) = 0;
};

// A small HTTP/1.1 server on one thread: one request a connection, and long responses. Meant for few clients and any
// number of attackers: everything about a connection is bounded in size, number and time.
class HttpServer {
 public:
  static constexpr size_t kMaxConnections = 128, kMaxStreams = 8;
  struct Limits {
    std::chrono::milliseconds request{5000};   // from the connection to the request's last byte
    std::chrono::milliseconds answer{30000};   // for a whole answer
    std::chrono::milliseconds stalled{15000};  // of a stream, without a byte taken
    std::chrono::milliseconds stuck{1000};     // an answer of which no byte is taken makes room where that is short
    std::chrono::milliseconds linger{1000};    // after an answer, for what the client still sends
    std::chrono::milliseconds tick{33};        // between parts of a stream
  };

  // Binds; port 0 = any. Throws InputError.
  HttpServer(const std::string& host, int port, AccessRules rules, HttpService& service, Limits limits);
  HttpServer(const std::string& host, int port, AccessRules rules, HttpService& service)
      : HttpServer(host, port, std::move(rules), service, Limits()) {}
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const { return port_; }
  // Until stop(), or until it cannot go on, which throws. Nobody can connect any more after either.
  void run();
  void wake();  // any thread: there is something new
  void stop();  // any thread

 private:
  using Clock = std::chrono::steady_clock;
  enum class Phase { reading, answering, streaming, lingering };
  struct Connection {
    int fd = -1;
    Phase phase = Phase::reading;
    Clock::time_point deadline;
    Clock::time_point taken;  // when the client last took a byte of the answer
    HttpRequestParser parser;
    std::string head, own_body;
    std::string_view body;
    size_t sent = 0;  // of head and body together
    std::unique_ptr<HttpStream> stream;
    bool closed = false;
  };

  void serve();
  void close_all();
  void accept_all();
  bool make_room();  // whether one went
  void read(Connection& c);
  void write(Connection& c);
  void answer(Connection& c);
  void send_answer(Connection& c, HttpAnswer answer);
  void refuse(Connection& c, int status);
  void feed_streams();
  void sweep();
  size_t stream_count() const;

  const AccessRules rules_;
  HttpService& service_;
  const Limits limits_;
  int listener_ = -1, wake_fd_ = -1;
  int port_ = 0;
  std::list<Connection> connections_;  // oldest first
  bool news_ = false, stopping_ = false;
  Clock::time_point next_tick_{};
  Clock::time_point deaf_until_{};  // no descriptor is left for who knocks: not asked before
};

}  // namespace dkb
