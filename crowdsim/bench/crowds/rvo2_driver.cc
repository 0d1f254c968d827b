// Agents of a square walk in all directions; prints the microseconds of an agent-step, one line a step.
// Compiled with the sources of RVO2 by crowdsim/bench/crowds/rvo2.py. Arguments: agents, agents/m2, steps.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "RVO.h"

int main(int, char **arguments) {
  const int count = std::atoi(arguments[1]);
  const float density = static_cast<float>(std::atof(arguments[2]));
  const int steps = std::atoi(arguments[3]);
  const float side = std::sqrt(static_cast<float>(count) / density);
  // Bodies as broad as fit: 0.3 m, in dense crowds less.
  const float radius = std::fmin(0.3F, 0.45F / std::sqrt(density));
  RVO::RVOSimulator simulator;
  simulator.setTimeStep(0.1F);
  // The 10 nearest within 15 m, as in the examples of RVO2.
  simulator.setAgentDefaults(15.0F, 10, 4.0F, 4.0F, radius, 2.0F);
  std::srand(1);
  const int across = static_cast<int>(std::ceil(std::sqrt(static_cast<float>(count))));
  std::vector<float> way(count);
  for (int i = 0; i < count; ++i) {
    const float x = (static_cast<float>(i % across) + 0.5F) * side / static_cast<float>(across);
    const float y = (static_cast<float>(i / across) + 0.5F) * side / static_cast<float>(across);
    simulator.addAgent(RVO::Vector2(x, y));
    way[i] = static_cast<float>(std::rand() % 16) * 0.3926991F;
  }
  for (int step = 0; step < steps; ++step) {
    for (int i = 0; i < count; ++i) {
      const RVO::Vector2 place = simulator.getAgentPosition(i);
      if (place.x() < 0 || place.y() < 0 || place.x() > side || place.y() > side)
        way[i] = std::atan2(side / 2 - place.y(), side / 2 - place.x());
      simulator.setAgentPrefVelocity(i, RVO::Vector2(1.34F * std::cos(way[i]), 1.34F * std::sin(way[i])));
    }
    const auto begin = std::chrono::steady_clock::now();
    simulator.doStep();
    const std::chrono::duration<double, std::micro> took = std::chrono::steady_clock::now() - begin;
    std::printf("%.4f\n", took.count() / count);
  }
  return 0;
}
