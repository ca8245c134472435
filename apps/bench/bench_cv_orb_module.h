/* SPDX-License-Identifier: Apache-2.0 */
#pragma once

/* The one function of libdkb_cv_orb.so. OpenCV is loaded with the module, so that whoever takes no times needs none.
   Runs cv::ORB::create(1000)->detectAndCompute on one grey image (rows without padding), on one thread.
   Returns the milliseconds taken, negative when OpenCV fails. */
extern "C" double dkb_cv_orb_1(const unsigned char* grey, int width, int height);
