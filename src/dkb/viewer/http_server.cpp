// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/http_server.h"

#include <fmt/format.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <vector>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

const char* reason_of(int status) {
  switch (status) {
    case 200:
      return "OK";
    case 400:
      return "Bad Request";
    case 401:
      return "Unauthorized";
    case 403:
      return "Forbidden";
    case 404:
      return "Not Found";
    case 405:
      return "Method Not Allowed";
    case 411:
      return "Length Required";
    case 413:
      return "Content Too Large";
    case 414:
      return "URI Too Long";
    case 431:
      return "Request Header Fields Too Large";
    case 503:
      return "Service Unavailable";
    case 505:
      return "HTTP Version Not Supported";
    default:
      return "Error";
  }
}

// How often a stream is asked although nothing is new: what it sends then shows whether its client is still there.
constexpr std::chrono::seconds kHeartbeat{2};
constexpr std::chrono::milliseconds kDeaf{100};

constexpr const char* kCommonHeaders =
    "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n"
    "X-Content-Type-Options: nosniff\r\n"
    "Referrer-Policy: no-referrer\r\n"
    "Cross-Origin-Resource-Policy: same-origin\r\n"
    "Cache-Control: no-store\r\n"
    "Connection: close\r\n\r\n";

int port_of(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  getsockname(socket, reinterpret_cast<sockaddr*>(&address), &size);
  if (address.ss_family == AF_INET6) return ntohs(reinterpret_cast<const sockaddr_in6&>(address).sin6_port);
  return ntohs(reinterpret_cast<const sockaddr_in&>(address).sin_port);
}

int listen_on(const std::string& host, int port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error = getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found); error != 0)
    throw InputError("--viewer-host: there is no \"" + host + "\" (" + gai_strerror(error) + ")");
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> guard(found, freeaddrinfo);
  int reason = 0;
  for (const addrinfo* a = found; a != nullptr; a = a->ai_next) {
    const int fd = socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
    if (fd < 0) {
      reason = errno;
      continue;
    }
    const int yes = 1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    if (bind(fd, a->ai_addr, a->ai_addrlen) == 0 && listen(fd, 512) == 0) return fd;
    reason = errno;
    close(fd);
  }
  const char* remedy = reason == EADDRNOTAVAIL
                           ? "that address is none of this machine's; give one that `ip addr` lists, or 0.0.0.0 for all"
                           : "give another port, or 0 for any free one";
  throw InputError(
      fmt::format("cannot serve the page at {}, port {} ({}); {}", host, port, std::strerror(reason), remedy));
}

}  // namespace

HttpServer::HttpServer(const std::string& host, int port, AccessRules rules, HttpService& service, Limits limits)
    : rules_(std::move(rules)), service_(service), limits_(limits), listener_(listen_on(host, port)) {
  port_ = port_of(listener_);
  wake_fd_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_fd_ < 0) {
    close(listener_);
    throw InputError("cannot serve the page: too many open files");
  }
}

HttpServer::~HttpServer() {
  close_all();
  close(wake_fd_);
}

void HttpServer::close_all() {
  if (listener_ >= 0) close(listener_);
  listener_ = -1;
  for (const Connection& c : connections_)
    if (!c.closed) close(c.fd);
  connections_.clear();
}

void HttpServer::wake() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(wake_fd_, &one, sizeof one);
}

void HttpServer::stop() {
  // A count that no number of wakes reaches.
  const uint64_t all = uint64_t{1} << 62;
  [[maybe_unused]] const ssize_t written = ::write(wake_fd_, &all, sizeof all);
}

void HttpServer::run() {
  try {
    serve();
  } catch (...) {
    close_all();
    throw;
  }
  close_all();
}

void HttpServer::serve() {
  std::vector<pollfd> fds;
  std::vector<Connection*> polled;
  while (!stopping_) {
    const bool deaf = Clock::now() < deaf_until_;
    fds.assign({{deaf ? -1 : listener_, POLLIN, 0}, {wake_fd_, POLLIN, 0}});
    polled.clear();
    Clock::time_point until = Clock::now() + std::chrono::seconds(5);
    if (deaf) until = std::min(until, deaf_until_);
    for (Connection& c : connections_) {
      const bool sends = c.sent < c.head.size() + c.body.size();
      fds.push_back({c.fd, static_cast<short>(POLLIN | (sends ? POLLOUT : 0)), 0});
      polled.push_back(&c);
      until = std::min(until, c.deadline);
    }
    const bool streams = stream_count() > 0;
    if (news_) until = std::min(until, next_tick_);
    if (streams) until = std::min(until, next_tick_ + kHeartbeat);
    const auto wait = std::chrono::ceil<std::chrono::milliseconds>(until - Clock::now()).count();
    if (poll(fds.data(), fds.size(), static_cast<int>(std::clamp<long>(wait, 0, 5000))) < 0 && errno != EINTR)
      throw std::system_error(errno, std::generic_category(), "poll");
    if (fds[1].revents != 0) {
      uint64_t count = 0;
      if (::read(wake_fd_, &count, sizeof count) > 0) {
        news_ = true;
        stopping_ = count >= uint64_t{1} << 62;
      }
    }
    for (size_t i = 0; i < polled.size(); ++i) {
      const short events = fds[i + 2].revents;
      Connection& c = *polled[i];
      if ((events & (POLLIN | POLLERR | POLLHUP)) != 0) read(c);
      if ((events & POLLOUT) != 0 && !c.closed) write(c);
    }
    sweep();
    if (fds[0].revents != 0) accept_all();
    if (streams && Clock::now() >= next_tick_ + kHeartbeat) news_ = true;
    feed_streams();
  }
}

size_t HttpServer::stream_count() const {
  return static_cast<size_t>(std::count_if(connections_.begin(), connections_.end(),
                                           [](const Connection& c) { return !c.closed && c.stream != nullptr; }));
}

void HttpServer::accept_all() {
  // Not for ever: those that are here already have their turn too.
  for (int n = 0; n < 64; ++n) {
    const int fd = accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd < 0) {
      // The listener stays readable: without a rest a whole core would go into asking.
      if ((errno == EMFILE || errno == ENFILE) && !make_room()) deaf_until_ = Clock::now() + kDeaf;
      return;
    }
    if (connections_.size() >= kMaxConnections) make_room();
    if (connections_.size() >= kMaxConnections) {
      close(fd);
      continue;
    }
    const int yes = 1, buffer = 512 * 1024;
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    // What the kernel holds for a slow client is old by the time it is read.
    setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
    Connection c;
    c.fd = fd;
    c.deadline = Clock::now() + limits_.request;
    connections_.push_back(std::move(c));
  }
}

// The oldest connection that still owes its request, is only waited for or does not take its answer goes.
bool HttpServer::make_room() {
  const Clock::time_point now = Clock::now();
  for (const Phase phase : {Phase::lingering, Phase::reading, Phase::answering}) {
    const auto oldest = std::find_if(connections_.begin(), connections_.end(), [&](const Connection& c) {
      return c.phase == phase && (phase != Phase::answering || now - c.taken >= limits_.stuck);
    });
    if (oldest == connections_.end()) continue;
    if (!oldest->closed) close(oldest->fd);
    connections_.erase(oldest);
    return true;
  }
  return false;
}

void HttpServer::sweep() {
  const Clock::time_point now = Clock::now();
  for (auto c = connections_.begin(); c != connections_.end();) {
    if (!c->closed && now >= c->deadline) {
      close(c->fd);
      c->closed = true;
    }
    c = c->closed ? connections_.erase(c) : std::next(c);
  }
}

void HttpServer::read(Connection& c) {
  std::array<char, 16384> buffer;
  const ssize_t n = recv(c.fd, buffer.data(), buffer.size(), 0);
  if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
  if (n <= 0) {
    close(c.fd);
    c.closed = true;
    return;
  }
  if (c.phase != Phase::reading) return;  // what comes after the request is not looked at
  const auto state = c.parser.feed({buffer.data(), static_cast<size_t>(n)});
  if (state == HttpRequestParser::State::refused) refuse(c, c.parser.status());
  if (state == HttpRequestParser::State::complete) answer(c);
}

void HttpServer::answer(Connection& c) {
  const HttpRequest& request = c.parser.request();
  if (const int status = rules_.refusal(request); status != 0) return refuse(c, status);
  HttpAnswer answer = service_.answer(request);
  if (answer.stream != nullptr && stream_count() >= kMaxStreams) return refuse(c, 503);
  send_answer(c, std::move(answer));
}

void HttpServer::refuse(Connection& c, int status) {
  HttpAnswer answer;
  answer.status = status;
  answer.own_body = fmt::format("{} {}\n", status, reason_of(status));
  send_answer(c, std::move(answer));
}

void HttpServer::send_answer(Connection& c, HttpAnswer answer) {
  c.own_body = std::move(answer.own_body);
  c.body = c.own_body.empty() ? answer.body : std::string_view(c.own_body);
  c.stream = std::move(answer.stream);
  c.head = fmt::format("HTTP/1.1 {} {}\r\nContent-Type: {}\r\n", answer.status, reason_of(answer.status), answer.type);
  if (c.stream == nullptr) c.head += fmt::format("Content-Length: {}\r\n", c.body.size());
  if (answer.status == 405) c.head += "Allow: GET, POST\r\n";
  c.head += kCommonHeaders;
  c.phase = c.stream != nullptr ? Phase::streaming : Phase::answering;
  c.taken = Clock::now();
  c.deadline = c.taken + (c.stream != nullptr ? limits_.stalled : limits_.answer);
  news_ = news_ || c.stream != nullptr;
  write(c);
}

void HttpServer::write(Connection& c) {
  while (c.sent < c.head.size() + c.body.size()) {
    const std::string_view rest =
        c.sent < c.head.size() ? std::string_view(c.head).substr(c.sent) : c.body.substr(c.sent - c.head.size());
    const ssize_t n = send(c.fd, rest.data(), rest.size(), MSG_NOSIGNAL);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
    if (n <= 0) {
      close(c.fd);
      c.closed = true;
      return;
    }
    c.sent += static_cast<size_t>(n);
    c.taken = Clock::now();
    if (c.phase == Phase::streaming) c.deadline = c.taken + limits_.stalled;
  }
  if (c.phase == Phase::answering) {
    // Closed at once, a connection whose client is still sending would be reset, and the answer lost.
    shutdown(c.fd, SHUT_WR);
    c.phase = Phase::lingering;
    c.deadline = Clock::now() + limits_.linger;
  }
}

void HttpServer::feed_streams() {
  const Clock::time_point now = Clock::now();
  if (!news_ || now < next_tick_) return;
  news_ = false;
  next_tick_ = now + limits_.tick;
  service_.tick(stream_count());
  for (Connection& c : connections_) {
    if (c.closed || c.stream == nullptr) continue;
    if (c.sent < c.head.size() + c.body.size()) {
      news_ = true;  // asked again when it has taken what it has
      continue;
    }
    c.own_body = c.stream->next();
    c.head.clear();
    c.body = c.own_body;
    c.sent = 0;
    if (c.body.empty()) {
      // Nothing to send is no fault of the client.
      c.deadline = now + limits_.stalled;
      continue;
    }
    news_ = true;  // there may be more than one part holds
    write(c);
  }
}

}  // namespace dkb
