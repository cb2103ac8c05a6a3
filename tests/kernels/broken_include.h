// The fault is on line 2.
uint broken_function(void) { return no_such_name; }
