// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/yaml_reader.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

const char* const kText = R"(name: a b
room:
  height: 2.5
  people: 3e0
  open: no
knots:
  - time: 1
  -
empty:
)";

TEST(YamlReader, ReadsWhatIsThereAndLeavesOtherFields) {
  const YamlReader file(kText, "s.yaml"), room = file.at("room");
  std::string name, floor = "wood";
  double height = 0;
  int people = 0;
  bool open = true;
  file.read("name", &name);
  room.read("floor", &floor, {"planks", "carpet"});
  room.read("height", &height, {2, 10});
  room.read("people", &people, {0, 30});
  room.read("open", &open);
  EXPECT_EQ(name, "a b");
  EXPECT_EQ(floor, "wood") << "a default is not judged";
  EXPECT_EQ(height, 2.5);
  EXPECT_EQ(people, 3) << "3e0 is a whole number";
  EXPECT_FALSE(open);
  EXPECT_TRUE(file.at("empty").empty());
  EXPECT_FALSE(file.at("name").has("x")) << "a text has no keys";
}

TEST(YamlReader, PlacesAreThoseOfTheKeysAndOfTheEntriesOfLists) {
  const YamlReader file(kText, "s.yaml");
  EXPECT_EQ(file.where(), "s.yaml");
  EXPECT_EQ(file.at("room").where(), "s.yaml:2");
  EXPECT_EQ(file.at("room").at("height").where(), "s.yaml:3");
  EXPECT_EQ(file.at("room").at("height").key(), "room.height");
  const std::vector<YamlReader> knots = file.at("knots").list(2);
  EXPECT_EQ(knots.at(0).line(), 7);
  EXPECT_EQ(knots.at(0).key(), "knots");
  EXPECT_EQ(knots.at(1).line(), 6) << "an empty entry has the list's";
}

TEST(YamlReader, FaultsNameFileLineWholeKeyAndWhatIsPossible) {
  const YamlReader file(kText, "s.yaml"), room = file.at("room");
  const auto error = test::input_error_of<std::function<void()>>;
  std::string text;
  double number = 0;
  int whole = 0;
  EXPECT_EQ(error([&] {
              room.read("height", &text, {"low", "2.6"});
            }),
            "s.yaml:3: room.height: \"2.5\" is not one of low, 2.6 (did you mean \"2.6\"?)");
  EXPECT_EQ(error([&] {
              room.read("height", &whole, {2, 10});
            }),
            "s.yaml:3: room.height: \"2.5\" is not a whole number");
  EXPECT_EQ(error([&] {
              room.read("height", &number, {3, 10});
            }),
            "s.yaml:3: room.height: 2.5 is out of range; it must be 3 ... 10");
  EXPECT_EQ(error([&] { room.read("open", &number); }), "s.yaml:5: room.open: \"no\" is not a number");
  EXPECT_EQ(error([&] { file.read("room", &number); }), "s.yaml:2: room: must be a number");
  EXPECT_EQ(error([&] { file.read("room", &text); }), "s.yaml:2: room: must be a text");
  EXPECT_EQ(error([&] { room.list(); }), "s.yaml:2: room: must be a list, e.g. [a, b]");
  EXPECT_EQ(error([&] { room.at("floor", "; give one"); }), "s.yaml:2: key \"room.floor\" is missing; give one");
  EXPECT_EQ(error([&] {
              room.check_keys({"height", "people", "opens"});
            }),
            "s.yaml:5: unknown key \"room.open\" (did you mean \"opens\"?); the keys are height, people, opens");
  EXPECT_EQ(error([&] { YamlReader(std::string(2 << 20, ' '), "s.yaml"); }),
            "s.yaml: is too large; at most 1 MiB is read");
  EXPECT_EQ(error([&] { YamlReader(std::string(1, '\0'), "s.yaml"); }), "s.yaml: is not a text file");
}

}  // namespace
}  // namespace dkb
