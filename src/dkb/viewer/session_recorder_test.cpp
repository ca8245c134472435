// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_recorder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>

#include "dkb/util/errors.h"
#include "dkb/viewer/session_file.h"
#include "dkb/viewer/stream_test_tools.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;
using test::StreamReader;

struct TempFile {
  const fs::path path = fs::temp_directory_path() / ("dkb_session_" + std::to_string(getpid()) + ".dkbs");
  ~TempFile() { fs::remove(path); }
};

ViewerOptions options() {
  ViewerOptions o;
  o.port.reset();
  o.camera = Camera{};
  o.camera.width = 64;
  o.camera.height = 48;
  o.camera.fx = o.camera.fy = 60;
  o.camera.cx = 32;
  o.camera.cy = 24;
  return o;
}

// Frame `i` of a session that makes a keyframe every third frame and closes a loop at frame 300.
struct Told {
  FrameResult result;
  Frame frame;
  MapSnapshot map;
  std::vector<Event> events;
};
Told told(int i) {
  Told t;
  t.result.frame = i;
  t.result.stamp_ns = int64_t{1'000'000'000} + int64_t{33'000'000} * i;
  t.result.state = i % 50 == 7 ? TrackingState::lost : TrackingState::tracking;
  const int keyframes = 1 + i / 3;
  if (t.result.tracked()) {
    t.result.world_from_cam = Rigid3({Eigen::Quaterniond::Identity()}, {i / 3.0, 0, 0});
    t.result.reference_keyframe = keyframes - 1;
  }
  t.result.features.resize(1000);
  const std::vector<uint8_t> grey(static_cast<size_t>(64 * 48), static_cast<uint8_t>(i));
  const std::vector<float> depth(static_cast<size_t>(64 * 48), 1 + 0.001F * static_cast<float>(i));
  FrameInput input;
  input.stamp_ns = t.result.stamp_ns;
  input.colour = {grey.data(), 64, 48, 64, PixelFormat::grey8};
  input.depth = {depth.data(), 64, 48, 256, PixelFormat::depth_f32};
  t.frame = Frame(options().camera, input);
  Map map = test::world(keyframes, 20);
  for (int k = 0; k < keyframes && i > 300; ++k)
    map.set_pose(k, map.cam_from_world(k) * Rigid3({Eigen::Quaterniond::Identity()}, {0, 0.3, 0}));
  std::vector<LoopInfo> loops;
  if (i > 300) loops.push_back({100, 0, false});
  t.map = {map.snapshot(), loops};
  if (i % 3 == 0) t.events.push_back({Event::Kind::keyframe, i, t.result.stamp_ns, i / 3, "rule"});
  return t;
}

void feed(SessionModel& model, SessionRecorder& recorder, int i) {
  Told t = told(i);
  recorder.wait_taken();
  model.show(std::move(t.result), std::move(t.frame), std::move(t.map), std::move(t.events));
  recorder.wake();
}

// What chunks from one place of the file to another tell; checkpoints are left out but for one that is begun with.
void play(const SessionFile& file, uint64_t from, uint64_t to, StreamReader& reader,
          std::vector<int>* frames = nullptr) {
  for (uint64_t at = from; at < to;) {
    const auto chunk = parse_chunk_head(file.read(at, at + kChunkHead).c_str());
    ASSERT_TRUE(chunk);
    const uint64_t end = at + kChunkHead + chunk->bytes;
    if ((chunk->flags & kCheckpoint) == 0 || at == from) {
      EXPECT_TRUE(reader.take(file.read(at + kChunkHead, end)));
      if (frames != nullptr) frames->push_back(chunk->frame);
    }
    at = end;
  }
}

void expect_same(const StreamReader& a, const StreamReader& b) {
  EXPECT_EQ(a.keyframes, b.keyframes);
  EXPECT_EQ(a.points, b.points);
  EXPECT_EQ(a.loops, b.loops);
  EXPECT_EQ(a.facts, b.facts);
  EXPECT_EQ(a.last_fact, b.last_fact);
  EXPECT_EQ(a.path, b.path);
  EXPECT_EQ(a.frame, b.frame);
  EXPECT_EQ(a.images, b.images);
}

TEST(SessionRecorder, LeavesAnEarlierRecordingToWhoIsWatchingIt) {
  const TempFile temp;
  const auto record = [&](int frames) {
    SessionModel model(options());
    SessionRecorder recorder(model, temp.path, false);
    for (int i = 0; i < frames; ++i) feed(model, recorder, i);
  };
  record(30);
  SessionFile watched(temp.path);
  const std::string before = watched.read(0, watched.size());
  record(3);
  watched.update();
  EXPECT_EQ(watched.read(0, watched.size()), before);
  EXPECT_EQ(SessionFile(temp.path).frame(), 2);
}

TEST(SessionRecorder, KeepsEveryFrameAndWhatALiveClientKnows) {
  const TempFile temp;
  SessionModel model(options());
  StreamReader live;
  constexpr int kFrames = 450;
  {
    SessionRecorder recorder(model, temp.path, false);
    SessionModel::Client client;
    client.images = client.depth = true;
    for (int i = 0; i < kFrames; ++i) {
      feed(model, recorder, i);
      if (i % 100 == 0) {  // reads what there is, while it grows
        recorder.wait_taken();
        EXPECT_EQ(SessionFile(temp.path).frame(), i);
      }
    }
    recorder.wait_taken();
    model.end(told(kFrames - 1).map);
    recorder.wake();
    recorder.wait_taken();
    const auto lock = model.hold();
    StreamWriter out;
    model.write(client, out, std::numeric_limits<size_t>::max());
    ASSERT_TRUE(live.take(out.bytes()));
  }
  const SessionFile file(temp.path);
  EXPECT_TRUE(file.ended());
  EXPECT_EQ(file.size(), fs::file_size(temp.path));
  EXPECT_EQ(file.frames(), kFrames);
  EXPECT_NEAR(file.seconds(), 0.033 * (kFrames - 1), 1e-9);
  StreamReader whole;
  std::vector<int> frames;
  play(file, 0, file.size(), whole, &frames);
  for (int i = 0; i < kFrames; ++i) EXPECT_EQ(std::count(frames.begin(), frames.end(), i) > 0, true) << i;
  EXPECT_TRUE(std::is_sorted(frames.begin(), frames.end()));
  EXPECT_EQ(whole.keyframes.size(), 150U);
  EXPECT_EQ(whole.points.size(), 3000U);
  EXPECT_EQ(whole.loops, 1U);
  EXPECT_EQ(whole.hellos, 1U);
  expect_same(whole, live);

  // Checkpoints: there are some, they do not double the file, and each holds all that came before it.
  ASSERT_GE(file.entries().size(), 4U);
  uint64_t in_checkpoints = 0;
  for (size_t i = 1; i < file.entries().size(); ++i) {
    const uint64_t at = file.entries()[i].offset;
    const auto head = parse_chunk_head(file.read(at, at + kChunkHead).c_str());
    const uint64_t end = at + kChunkHead + head->bytes;
    in_checkpoints += end - at;
    StreamReader played, begun;
    play(file, 0, at, played);
    play(file, at, end, begun);
    expect_same(begun, played);
    play(file, end, file.size(), begun);
    expect_same(begun, live);
  }
  EXPECT_LE(in_checkpoints, file.size() / 2);
}

TEST(SessionRecorder, LeavesAFileWithoutAnEndWhenTheSessionHasNone) {
  const TempFile temp;
  {
    SessionModel model(options());
    SessionRecorder recorder(model, temp.path, true);
    for (int i = 0; i < 5; ++i) feed(model, recorder, i);
  }
  const SessionFile file(temp.path);
  EXPECT_FALSE(file.ended());
  EXPECT_EQ(file.frame(), 4);
}

TEST(SessionRecorder, EndsWithTheLastWholeChunkWhenTheDiskIsFull) {
  const TempFile temp;
  SessionModel model(options());
  auto* const handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  rlimit limit = before;
  limit.rlim_cur = 100'000;  // no file grows beyond it: a write fails half-way, as on a full disk
  setrlimit(RLIMIT_FSIZE, &limit);
  std::vector<std::string> warnings;
  {
    SessionRecorder recorder(model, temp.path, false);
    for (int i = 0; i < 60; ++i) feed(model, recorder, i);
    recorder.wait_taken();
    warnings = recorder.take_warnings();
    EXPECT_TRUE(recorder.take_warnings().empty());
  }
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("the recording has ended: " + temp.path.string()), std::string::npos);
  const SessionFile file(temp.path);
  EXPECT_FALSE(file.damaged());
  EXPECT_EQ(file.size(), fs::file_size(temp.path));
  EXPECT_GT(file.frame(), 0);
  EXPECT_LT(file.frame(), 59);
}

TEST(SessionRecorder, LeavesRoomOnTheDiskAndTheFileThatIsThere) {
  const TempFile temp;
  std::ofstream(temp.path) << "before";
  SessionModel model(options());
  EXPECT_THROW(SessionRecorder(model, temp.path, true, uintmax_t{1} << 62), OutputError);
  EXPECT_EQ(fs::file_size(temp.path), 6u);
}

TEST(SessionRecorder, SaysThatItsFileCannotBeWritten) {
  SessionModel model(options());
  EXPECT_THROW(SessionRecorder(model, "/no/such/folder/session.dkbs", true), InputError);
}

}  // namespace
}  // namespace dkb
