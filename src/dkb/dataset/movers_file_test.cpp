// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/movers_file.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {

const std::string kHeader = "timestamp,id,class,x,y,z,vx,vy,vz,position_sd,box_x,box_y,box_w,box_h\n";  // of 0.2.0
const std::string kWritten = "timestamp,id,class,x,y,z,vx,vy,vz,position_sd,box_x,box_y,box_w,box_h,velocity_sd\n";
const std::string kRow = "1.50,7,person,1,2,3,0.5,-0.5,0,0.04,10,20,30.5,40\n";

MoverRow example() {
  MoverRow row{1.5, "1.50", {}};
  row.mover = {7, "person", {1, 2, 3}, {0.5, -0.5, 0}, 0.04, Matrix6d::Zero(), {0, 0, 0}, {10, 20, 30.5f, 40}};
  return row;
}

std::string error_of(const std::string& text) {
  return test::input_error_of([&] { parse_movers(text, "m.csv"); });
}

TEST(MoversFile, RowsAreWrittenWithTheStampAsRead) {
  EXPECT_EQ(
      movers_to_csv({example()}),
      kWritten + "1.50,7,person,1.0000,2.0000,3.0000,0.5000,-0.5000,0.0000,0.0400,10.00,20.00,30.50,40.00,0.0000\n");
  EXPECT_EQ(movers_to_csv({}), kWritten);
}

TEST(MoversFile, RowsAreReadWithTheirUnits) {
  EXPECT_EQ(parse_movers(kHeader + kRow, "m.csv"), (MoverRows{example()}));
}

TEST(MoversFile, TheVelocityHasAStandardDeviation) {
  MoverRow row = example();
  row.mover.covariance.diagonal().tail<3>() << 0.04, 0.01, 0.04;  // mean 0.03
  const std::string text = movers_to_csv({row});
  EXPECT_EQ(text.substr(text.rfind(',')), ",0.1732\n");
  EXPECT_NEAR(parse_movers(text, "m.csv")[0].mover.covariance(5, 5), 0.03, 1e-5);
  EXPECT_EQ(error_of(kWritten + kRow).find("m.csv:2: 14 of 15 columns"), 0u);
  EXPECT_EQ(error_of(kWritten + "1.50,7,person,1,2,3,0.5,-0.5,0,0.04,10,20,30.5,40,-1\n").find("m.csv:2: velocity_sd"),
            0u);
}

TEST(MoversFile, ByteOrderMarksCarriageReturnsAndEmptyLinesAreTolerated) {
  EXPECT_EQ(
      parse_movers("\xEF\xBB\xBF" + kHeader.substr(0, kHeader.size() - 1) + "\r\n\r\n" + kRow + "\n", "m.csv").size(),
      1u);
  EXPECT_TRUE(parse_movers(kHeader, "m.csv").empty());
}

TEST(MoversFile, WhatIsWrittenIsReadBack) {
  const test::TempFolder temp;
  write_file_atomically(temp / "movers.csv", movers_to_csv({example()}));
  EXPECT_EQ(read_movers(temp / "movers.csv"), (MoverRows{example()}));
}

TEST(MoversFile, ClassNamesStayOneColumn) {
  MoverRow row = example();
  row.mover.class_name = "cell phone, \"old\"";
  EXPECT_EQ(parse_movers(movers_to_csv({row}), "m.csv")[0].mover.class_name, "cell_phone___old_");
  row.mover.class_name = "";
  EXPECT_EQ(parse_movers(movers_to_csv({row}), "m.csv")[0].mover.class_name, "object");
}

TEST(MoversFile, BadLinesAreNamed) {
  for (const char* bad :
       {"1.6,7,person,1,2,3,0,0,0,0,1,2,3", "1.6,7,person,1,2,3,0,0,0,0,1,2,3,4,5", "x,7,person,1,2,3,0,0,0,0,1,2,3,4",
        "1.6,0,person,1,2,3,0,0,0,0,1,2,3,4", "1.6,1.5,person,1,2,3,0,0,0,0,1,2,3,4", "1.6,7,,1,2,3,0,0,0,0,1,2,3,4",
        "1.6,7,person,nan,2,3,0,0,0,0,1,2,3,4", "1.6,7,person,1,2,inf,0,0,0,0,1,2,3,4",
        "1.6,7,person,1,2,3,,0,0,0,1,2,3,4", "1.6,7,person,1,2,3,0,0,0,-1,1,2,3,4",
        "1.6,7,person,1,2,3,0,0,0,0,1,2,-3,4", "1.4,8,person,1,2,3,0,0,0,0,1,2,3,4",
        "1.50,7,person,1,2,3,0,0,0,0,1,2,3,4", "1.6,99999999999,person,1,2,3,0,0,0,0,1,2,3,4"})
    EXPECT_EQ(error_of(kHeader + kRow + bad + "\n").find("m.csv:3: "), 0u)
        << bad << ": " << error_of(kHeader + kRow + bad + "\n");
}

TEST(MoversFile, AnotherHeaderOrNoneIsRefused) {
  EXPECT_EQ(error_of("timestamp,id\n" + kRow).find("m.csv:1: the header is"), 0u);
  EXPECT_EQ(error_of(kRow).find("m.csv:1: the header is"), 0u);
  EXPECT_EQ(error_of("").find("m.csv:1: the file is empty"), 0u);
  EXPECT_THROW(read_movers("/nowhere/movers.csv"), InputError);
}

TEST(MoversFile, AnyMutationIsReadOrRefused) {
  const std::string whole = kHeader + kRow + "1.6,7,person,1,2,3,0,0,0,0.04,1,2,3,4\n";
  Random random(4);
  for (int i = 0; i < 20000; ++i) {
    std::string text = whole;
    for (uint32_t k = 1 + random.below(4); k > 0; --k)
      text[kHeader.size() / (1 + random.below(2)) +
           random.below(static_cast<uint32_t>(whole.size() - kHeader.size()))] = static_cast<char>(random.below(256));
    try {
      for (const MoverRow& row : parse_movers(text, "m.csv")) {
        EXPECT_GE(row.mover.id, 1);
        EXPECT_GE(row.mover.box.w, 0);
        EXPECT_TRUE(row.mover.position_in_world.allFinite());
      }
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find("m.csv:"), 0u);
    }
  }
}

}  // namespace
}  // namespace dkb
