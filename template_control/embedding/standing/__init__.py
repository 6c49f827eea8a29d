"""Standing, starting to walk and stopping: planners whose double stance is a curve in time."""
