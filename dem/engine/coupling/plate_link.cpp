#include "coupling/plate_link.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstring>

#include "error.h"
#include "lammps.h"

namespace LAMMPS_NS {

namespace {
const long long FINISHED = -1, CHECKPOINT = -2;  // in the place of the step
}

PlateLink::PlateLink(LAMMPS *lmp, const std::string &to_plate, const std::string &from_plate, int modes)
    : amplitude(modes), rate(modes), lmp_(lmp), to_(to_plate), from_(from_plate),
      plate_(PlateWatchdog::from_environment()) {}

PlateLink::~PlateLink() {
  if (out_ >= 0) close(out_);
  if (in_ >= 0) close(in_);
}

// A pipe opens when the other side opens it too, and both sides open `to_plate` first. The engine opens without
// blocking, so that it can see a plate that is stuck while it waits.
void PlateLink::open() {
  std::signal(SIGPIPE, SIG_IGN);  // a plate that is gone shows as an error of write
  const useconds_t PAUSE_us = 10000;
  while ((out_ = ::open(to_.c_str(), O_WRONLY | O_NONBLOCK)) < 0 && errno == ENXIO) {
    check_plate();
    usleep(PAUSE_us);
  }
  in_ = ::open(from_.c_str(), O_RDONLY | O_NONBLOCK);
  if (out_ < 0 || in_ < 0) lmp_->error->one(FLERR, ("Cannot open the plate's files " + to_ + " and " + from_).c_str());
  fcntl(out_, F_SETFL, 0);
}

void PlateLink::send(long long step, long long co_steps, long long extrapolated, const double *modal_force) {
  std::vector<double> words(3);
  words.insert(words.end(), modal_force, modal_force + amplitude.size());
  std::memcpy(&words[0], &step, 8);
  std::memcpy(&words[1], &co_steps, 8);
  std::memcpy(&words[2], &extrapolated, 8);
  const char *bytes_of = reinterpret_cast<const char *>(words.data());
  for (size_t size = 8 * words.size(), sent = 0; sent < size;) {
    const ssize_t bytes = write(out_, bytes_of + sent, size - sent);
    if (bytes <= 0) lmp_->error->one(FLERR, "The plate does not read any more");
    sent += bytes;
  }
}

void PlateLink::receive(void *data, size_t bytes) {
  while (!answered_) wait_for_input();  // a pipe that the plate has yet to open would read as one that it has closed
  for (size_t got = 0; got < bytes;) {
    const ssize_t some = read(in_, static_cast<char *>(data) + got, bytes - got);
    if (some < 0 && (errno == EAGAIN || errno == EINTR)) {
      wait_for_input();
      continue;
    }
    if (some <= 0) lmp_->error->one(FLERR, "The plate does not answer any more");
    got += some;
  }
}

void PlateLink::wait_for_input() {
  const int POLL_ms = 200;
  pollfd input = {in_, POLLIN, 0};
  if (poll(&input, 1, POLL_ms) != 0) answered_ = true;
  else check_plate();
}

void PlateLink::check_plate() {
  const std::string trouble = plate_.trouble();
  if (!trouble.empty()) lmp_->error->one(FLERR, trouble.c_str());
}

void PlateLink::message(long long step, long long co_steps_passed, long long extrapolated_co_steps,
                        const double *modal_force) {
  if (out_ < 0) open();
  send(step, co_steps_passed, extrapolated_co_steps, modal_force);
  receive_answer(step);
  receive(&reach, 8);
  receive(amplitude.data(), 8 * amplitude.size());
  receive(rate.data(), 8 * rate.size());
  check_answer(step);
}

// What is no number would end the run as an unstable one of the engine.
void PlateLink::check_answer(long long step) const {
  auto is_wrong = [](double number) { return !std::isfinite(number); };
  const char *wrong = nullptr;
  if (is_wrong(reach) || reach < 0) wrong = "reach_m";
  if (std::any_of(amplitude.begin(), amplitude.end(), is_wrong)) wrong = "amplitude";
  if (std::any_of(rate.begin(), rate.end(), is_wrong)) wrong = "rate";
  if (!wrong) return;
  lmp_->error->one(FLERR, ("The plate answered step " + std::to_string(step) + " with a wrong " + wrong +
                           "; allowed are finite numbers, and a reach_m from 0 on").c_str());
}

void PlateLink::receive_answer(long long step) {
  long long answered;
  receive(&answered, 8);
  if (answered != step) lmp_->error->one(FLERR, "The plate answered another step than the one asked");
}

// Sends a message without forces and waits until the plate has repeated its kind.
void PlateLink::tell(long long kind, long long step) {
  std::vector<double> nothing(1 + 2 * amplitude.size());
  send(kind, step, 0, nothing.data());
  receive_answer(kind);
  receive(nothing.data(), 8 * nothing.size());
}

void PlateLink::checkpoint(long long step) { tell(CHECKPOINT, step); }

void PlateLink::finish() {
  if (out_ >= 0) tell(FINISHED, 0);
}

}  // namespace LAMMPS_NS
