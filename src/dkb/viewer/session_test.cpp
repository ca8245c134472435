// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session.h"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <filesystem>
#include <future>

#include "dkb/viewer/page_files.h"
#include "dkb/viewer/session_file.h"
#include "dkb/viewer/stream_test_tools.h"

namespace dkb {

// The page's files are the module's.
const PageFile* page_file(std::string_view) {
  return nullptr;
}

namespace {

DenseMap triangle() {
  DenseMap map;
  map.mesh.vertices = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  map.mesh.colours = {Rgb(), Rgb(), Rgb()};
  map.mesh.triangles = {{0, 1, 2}};
  return map;
}

TEST(Session, TheLastDenseMapIsShownThoughAnEarlierOneIsBeingMade) {
  const auto path = std::filesystem::temp_directory_path() / ("dkb_dense_" + std::to_string(getpid()) + ".dkbs");
  ViewerOptions options;
  options.port.reset();
  options.record = path;
  {
    Session session(options);
    std::promise<void> handing_over;
    session.show_dense_map([begun = handing_over.get_future().share()] {
      begun.wait();
      poll(nullptr, 0, 50);  // who does not wait has returned by then
      return DenseMap();
    });
    EXPECT_FALSE(session.wants_dense_map());
    session.show({}, Frame(), {test::world(1, 1).snapshot(), {}}, {});
    handing_over.set_value();
    session.show_dense_map(triangle);
    session.ended({test::world(1, 1).snapshot(), {}});
  }
  const SessionFile file(path);
  test::StreamReader reader;
  EXPECT_TRUE(reader.take(file.read(0, file.size())));
  EXPECT_EQ(reader.counts[static_cast<int>(StreamMessage::surface)], 1U);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace dkb
